#include "client/render/features.h"

#include <algorithm>

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
    for (int x = 0; x < options.width; ++x) {
      const std::size_t pixel = std::size_t(y) * std::size_t(options.width) + std::size_t(x);
      for (std::uint32_t s = 0; s < samples; ++s) {
        RandomStream random(options.seed, RandomPurpose::kFeatures,
                            std::uint64_t{pixel} * samples + s);
        const float u = random.Uniform(), v = random.Uniform();
        const auto [dx, dy] = JitterInPixel(s, samples, u, v);
        branches.Begin(camera.Through(static_cast<float>(x) + dx, static_cast<float>(y) + dy));
        while (const auto met = branches.Next()) {
          const auto& [branch, hit] = *met;
          if (IsSpecular(*hit.material)) {
            branches.Scatter(branch, hit, random);
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
