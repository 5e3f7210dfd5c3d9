#include "client/render/features.h"

#include <algorithm>
#include <vector>

#include "client/render/branches.h"
#include "client/render/camera_rays.h"
#include "client/trace/random.h"
#include "tbb/parallel_for.h"

namespace treelight::client {
namespace {

Rgb AlbedoOf(const Material& material) {
  const Rgb sum = material.reflectance + material.specular + material.emission;
  return {std::min(sum.r, 1.0f), std::min(sum.g, 1.0f), std::min(sum.b, 1.0f)};
}

bool IsSpecular(const Material& material) {
  return material.surface == Surface::kMirror || material.surface == Surface::kDielectric ||
         material.surface == Surface::kPane;
}

}  // namespace

FeatureLayers TraceFeatures(const Intersector& intersector, const FeatureOptions& options) {
  FeatureLayers layers{.albedo = Image(options.width, options.height),
                       .normals = Image(options.width, options.height)};
  const CameraRays camera(intersector.scene().camera, options.width, options.height);
  const std::uint32_t samples = options.samples_per_pixel;
  const float share = 1 / static_cast<float>(samples);
  tbb::parallel_for(0, options.height, [&](int y) {
    Branches branches(intersector);
    const std::size_t first_pixel = std::size_t(y) * std::size_t(options.width);
    const std::size_t count = std::size_t(options.width) * samples;
    for (std::size_t done = 0; done < count; done += kPacketSize) {
      // Samples of the row, pixel by pixel: their camera rays are a packet.
      std::vector<Ray> rays;
      std::vector<RandomStream> randoms;
      for (std::size_t i = done; i < std::min(done + kPacketSize, count); ++i) {
        RandomStream& random = randoms.emplace_back(options.seed, RandomPurpose::kFeatures,
                                                    std::uint64_t{first_pixel} * samples + i);
        const float u = random.Uniform(), v = random.Uniform();
        const auto [dx, dy] = JitterInPixel(static_cast<std::uint32_t>(i % samples), samples, u, v);
        rays.push_back(
            camera.Through(static_cast<float>(i / samples) + dx, static_cast<float>(y) + dy));
      }
      const auto hits = intersector.IntersectPacket(rays);
      for (std::size_t k = 0; k < rays.size(); ++k) {
        const std::size_t pixel = first_pixel + (done + k) / samples;
        branches.Begin(rays[k], hits[k]);
        while (const auto met = branches.Next()) {
          const auto& [branch, hit] = *met;
          if (IsSpecular(*hit.material)) {
            branches.Scatter(branch, hit, randoms[k]);
            continue;
          }
          const Vec3& n = hit.shading_normal;
          layers.albedo.pixels[pixel] += share * (branch.weight * AlbedoOf(*hit.material));
          layers.normals.pixels[pixel] += (share * MaxChannel(branch.weight)) * Rgb{n.x, n.y, n.z};
        }
      }
    }
  });
  return layers;
}

}  // namespace treelight::client
