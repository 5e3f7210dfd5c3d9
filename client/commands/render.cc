#include <algorithm>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "client/commands/command.h"
#include "client/commands/output.h"
#include "client/commands/picture_output.h"
#include "client/commands/render_options.h"
#include "client/commands/render_progressive.h"
#include "client/commands/render_report.h"
#include "client/commands/server_option.h"
#include "client/photon_map_client.h"
#include "client/progress.h"
#include "client/render/features.h"
#include "client/render/gather_radius.h"
#include "client/render/image_file.h"
#include "client/render/map_upload.h"
#include "client/render/path_tracer.h"
#include "client/render/photon_renderer.h"
#include "client/render/stopwatch.h"
#include "client/trace/photon_tracer.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

/// Samples per pixel of albedo and normals.
constexpr std::uint32_t kFeatureSamples = 16;

/// Refuses a scene of which a reference would lack light, or warns where that was allowed.
absl::Status CheckComplete(const Scene& scene, const RenderChoice& choice) {
  const auto missing = MissingFromReference(scene);
  if (!missing) return absl::OkStatus();
  if (!choice.allow_incomplete) {
    return absl::FailedPreconditionError(fmt::format(
        "no reference of {}: {} cannot be path-traced; give the light a size (a surface that "
        "emits), or leave that light out with --allow-incomplete",
        choice.scene.scene, *missing));
  }
  Warn(fmt::format("the reference lacks {}", *missing));
  return absl::OkStatus();
}

absl::Status RenderReference(const Intersector& scene, const RenderChoice& choice,
                             const Viewer& viewer) {
  if (auto status = CheckComplete(scene.scene(), choice); !status.ok()) return status;
  PathTraceOptions trace = choice.reference_options();
  const Stopwatch begin;
  Progress progress("path-trace",
                    std::uint64_t{trace.samples_per_pixel} * trace.width * trace.height, "samples");
  trace.progress = [&](std::uint64_t samples) { progress.Update(samples); };
  trace.preview = viewer.preview;
  const auto traced = PathTrace(scene, trace);
  progress.End();
  if (!traced.ok()) return traced.status();
  const double seconds = begin.Seconds();
  fmt::print(
      "path-traced with {} samples per pixel in {:.1f} s, {:.1f} Mrays/s; noise {:.5f} (standard "
      "error, root mean square)\n",
      traced->samples_per_pixel, seconds, static_cast<double>(traced->rays) / seconds / 1e6,
      traced->noise);
  if (traced->noise > trace.target_noise && trace.target_noise > 0) {
    Warn(fmt::format("the noise is over {} still: --spp ended it at {}", trace.target_noise,
                     trace.samples_per_pixel));
  }
  return viewer.finish(traced->image);
}

absl::StatusOr<PhotonRenderedImage> GatherPicture(const Intersector& scene, PhotonMapClient& client,
                                                  const PhotonMaps& maps,
                                                  PhotonRenderOptions render,
                                                  const Viewer& viewer) {
  Progress progress("render",
                    std::uint64_t{render.camera.samples_per_pixel} * render.width * render.height,
                    "samples");
  render.progress = [&](std::uint64_t samples) { progress.Update(samples); };
  render.preview = viewer.preview;
  return RenderPhotonMaps(scene, client, maps, render);
}

absl::StatusOr<TracedPhotons> TraceScene(const Intersector& scene, const RenderChoice& choice) {
  Progress progress("trace", choice.photon_count + choice.caustic_photon_count, "photons");
  return TracePhotons(scene,
                      {.indirect_photons = choice.photon_count,
                       .caustic_photons = choice.caustic_photon_count,
                       .seed = choice.seed,
                       .progress = [&](std::uint64_t photons) { progress.Update(photons); }});
}

absl::StatusOr<UploadedMaps> BuildMaps(PhotonMapClient& client, const TracedPhotons& photons,
                                       const RenderChoice& choice) {
  Progress progress("upload", photons.indirect.size() + photons.caustic.size(), "photons");
  return UploadMaps(
      client, photons,
      {.name = choice.map_name.empty() ? SceneName(choice.scene.scene) : choice.map_name,
       .time_to_live = choice.keep_maps ? std::chrono::milliseconds(0) : kTimeToLive,
       .progress = [&](std::uint64_t sent) { progress.Update(sent); }});
}

/// The radii that were given, and for maps without one, one that follows the photons.
absl::StatusOr<GatherRadii> ChooseRadii(PhotonMapClient& client, const TracedPhotons& photons,
                                        const PhotonMaps& maps, const RenderChoice& choice) {
  const PhotonRenderOptions defaults;
  GatherRadii radii = choice.radii;
  const auto choose = [&client](const std::optional<MapRef>& map, const Photons& set,
                                std::uint32_t k, double quantile, std::optional<float>& radius) {
    if (!map || radius) return absl::OkStatus();
    k = static_cast<std::uint32_t>(std::min<std::size_t>(k, set.size()));
    const auto chosen = RadiusOfNearest(client, *map, set, k, quantile);
    if (chosen.ok()) radius = *chosen;
    return chosen.status();
  };
  const auto k_or = [](std::uint32_t k, std::uint32_t otherwise) { return k > 0 ? k : otherwise; };
  auto status =
      choose(maps.indirect, photons.indirect, k_or(choice.render.indirect.k, defaults.indirect.k),
             kIndirectRadiusQuantile, radii.indirect);
  status.Update(choose(maps.caustic, photons.caustic,
                       k_or(choice.render.caustic.k, defaults.caustic.k), kCausticRadiusQuantile,
                       radii.caustic));
  if (!status.ok()) return status;
  return radii;
}

/// What the gathers of the picture did in the trees; a warning where the server does not tell.
MapTraversals SampleTraversals(PhotonMapClient& client, const PhotonMaps& maps,
                               const PhotonRenderedImage& render,
                               const PhotonRenderOptions& options) {
  MapTraversals traversals;
  const auto sample = [&client](const std::optional<MapRef>& map, const EstimateOptions& estimate,
                                const GatherCost& cost) -> std::optional<TraversalCost> {
    if (!map || cost.sample.empty()) return std::nullopt;
    const auto traversal = GatherSample(client, *map, estimate, cost.sample);
    if (traversal.ok()) return *traversal;
    Warn(fmt::format("no statistics of {}: {}", map->name,
                     std::string(traversal.status().message())));
    return std::nullopt;
  };
  traversals.indirect = sample(maps.indirect, options.indirect, render.indirect);
  traversals.caustic = sample(maps.caustic, options.caustic, render.caustic);
  return traversals;
}

/// The viewer gets the picture as soon as there is one: what the server refuses after that is no
/// more than a warning.
absl::Status RenderByPhotons(const Intersector& scene, const RenderChoice& choice,
                             const GlobalOptions& global, const Viewer& viewer) {
  const auto connected = Connect(global);
  if (!connected.ok()) return connected.status();
  PhotonMapClient& client = **connected;
  // Before any work: is there a server?
  if (const auto info = client.GetServerInfo(); !info.ok()) return info.status();

  RenderTimes times;
  const Stopwatch begin;
  const auto photons = TraceScene(scene, choice);
  if (!photons.ok()) return photons.status();
  times.trace_s = begin.Seconds();

  const auto maps = BuildMaps(client, *photons, choice);
  if (!maps.ok()) return maps.status();
  times.build_s = maps->seconds;

  const Stopwatch rendering;
  const auto radii = ChooseRadii(client, *photons, maps->refs(), choice);
  const PhotonRenderOptions options = choice.photon_options(radii.value_or(GatherRadii{}));
  const auto render =
      radii.ok() ? GatherPicture(scene, client, maps->refs(), options, viewer) : radii.status();
  times.render_s = rendering.Seconds();
  times.whole_s = begin.Seconds();
  const absl::Status finished = render.ok() ? viewer.finish(render->image) : render.status();
  MapTraversals traversals;
  if (finished.ok()) traversals = SampleTraversals(client, maps->refs(), *render, options);
  if (!choice.keep_maps) {
    const auto deleted = DeleteMaps(client, maps->refs());
    if (finished.ok() && !deleted.ok())
      Warn(fmt::format("the maps are not deleted: {}", std::string(deleted.message())));
  }
  if (!finished.ok()) return finished;
  if (photons->report.caustic.paths == 0 && choice.caustic_photon_count > 0)
    fmt::print("caustic map: none, since nothing in the scene is mirror, glass or glossy\n");
  fmt::print("{}", FormatRender(*photons, *maps, *radii, *render, traversals, times));
  return absl::OkStatus();
}

/// The picture that the result is compared with, of the size of the result.
absl::StatusOr<std::optional<Image>> ReadReference(const RenderChoice& choice) {
  if (choice.compare_path.empty()) return std::nullopt;
  auto reference = ReadExr(choice.compare_path);
  if (!reference.ok()) return reference.status();
  const auto size = Compare(Image(choice.render.width, choice.render.height), *reference);
  if (!size.ok()) return size.status();
  return *std::move(reference);
}

absl::Status Run(const RenderChoice& choice, const GlobalOptions& global) {
  // Before any work: can the picture be written, and is there what it is compared with?
  auto output = PictureOutput::Open(choice.output_paths, choice.preview_path);
  if (!output.ok()) return output.status();
  const auto reference = ReadReference(choice);
  if (!reference.ok()) return reference.status();
  auto loaded = LoadChosenScene(choice.scene);
  if (!loaded.ok()) return loaded.status();
  ImageFileOptions file{.exposure = choice.exposure.value_or(loaded->exposure)};
  const auto scene = Intersector::Create(std::move(loaded->scene));
  if (!scene.ok()) return scene.status();

  Viewer viewer;
  viewer.preview.interval_s = choice.preview_interval_s;
  if (!choice.preview_path.empty())
    viewer.preview.show = [&](const Image& image) { output->Preview(image, file); };
  viewer.finish = [&](const Image& image) {
    FeatureLayers layers;
    if (choice.layers) {
      layers = TraceFeatures(*scene, {.width = image.width,
                                      .height = image.height,
                                      .samples_per_pixel = kFeatureSamples,
                                      .seed = choice.seed});
      file.layers = &layers;
    }
    const auto written = output->Write(image, file);
    file.layers = nullptr;
    if (!written.ok() || !*reference) return written;
    const auto error = Compare(image, **reference);
    if (!error.ok()) return error.status();
    fmt::print("{}", FormatError(*error, choice.compare_path));
    return absl::OkStatus();
  };
  if (*reference) viewer.reference = &**reference;
  if (choice.reference) return RenderReference(*scene, choice, viewer);
  return choice.progressive ? RenderInPasses(*scene, choice, global, viewer)
                            : RenderByPhotons(*scene, choice, global, viewer);
}

}  // namespace

void AddRenderCommand(CLI::App& app, GlobalOptions& global) {
  const auto choice = std::make_shared<RenderChoice>();
  CLI::App* command =
      app.add_subcommand("render", "Renders a scene with photon maps of the server");
  AddRenderOptions(*command, *choice);
  command->callback([choice, &global] {
    CheckRenderOptions(*choice);
    global.action = [choice, &global] { return Run(*choice, global); };
  });
}

}  // namespace treelight::client
