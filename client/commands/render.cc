#include <algorithm>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/output.h"
#include "client/commands/render_report.h"
#include "client/commands/scene_option.h"
#include "client/output_file.h"
#include "client/photon_map_client.h"
#include "client/progress.h"
#include "client/render/image_file.h"
#include "client/render/map_upload.h"
#include "client/render/path_tracer.h"
#include "client/render/photon_renderer.h"
#include "client/trace/photon_tracer.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

using Clock = std::chrono::steady_clock;

/// Maps outlive a renderer that was killed by no more than this.
constexpr std::chrono::hours kTimeToLive{24};

constexpr std::uint32_t kReferenceSamples = 256;

struct Options {
  SceneChoice scene;
  std::string map_name, compare_path;
  std::vector<std::string> output_paths;
  std::uint64_t photon_count = 1'000'000, caustic_photon_count = 200'000, seed = 1;
  std::optional<std::uint32_t> samples_per_pixel;
  PhotonRenderOptions render;
  ImageFileOptions file;
  std::optional<float> exposure;
  bool reference = false, keep_maps = false;
};

double SecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// A file of the picture, opened before any work.
struct Output {
  std::string path;
  OutputFile file;
};

absl::StatusOr<std::vector<Output>> OpenOutputs(const std::vector<std::string>& paths) {
  std::vector<Output> outputs;
  for (const std::string& path : paths) {
    auto file = OutputFile::Create(path);
    if (!file.ok()) return file.status();
    outputs.push_back({path, *std::move(file)});
  }
  return outputs;
}

/// Writes the picture to every output and compares it where that was asked for.
absl::Status Finish(const Image& image, const std::optional<Image>& reference,
                    const Options& options, std::vector<Output>& outputs) {
  for (Output& output : outputs) {
    const auto bytes = EncodeImage(image, output.path, options.file);
    if (!bytes.ok()) return bytes.status();
    if (auto status = output.file.Write(*bytes); !status.ok()) return status;
    if (auto status = output.file.Commit(); !status.ok()) return status;
    fmt::print("picture: {}\n", output.path);
  }
  if (!reference) return absl::OkStatus();
  const auto error = Compare(image, *reference);
  if (!error.ok()) return error.status();
  fmt::print("{}", FormatError(*error, options.compare_path));
  return absl::OkStatus();
}

absl::StatusOr<Image> RenderReference(const Intersector& scene, const Options& options) {
  PathTraceOptions trace{.width = options.render.width,
                         .height = options.render.height,
                         .samples_per_pixel = options.samples_per_pixel.value_or(kReferenceSamples),
                         .seed = options.seed};
  const auto begin = Clock::now();
  Progress progress("path-trace",
                    std::uint64_t{trace.samples_per_pixel} * trace.width * trace.height, "samples");
  trace.progress = [&](std::uint64_t samples) { progress.Update(samples); };
  auto traced = PathTrace(scene, trace);
  progress.End();
  if (!traced.ok()) return traced.status();
  const double seconds = SecondsSince(begin);
  fmt::print(
      "path-traced with {} samples per pixel in {:.1f} s, {:.1f} Mrays/s; noise {:.5f} (standard "
      "error, "
      "root mean square)\n",
      trace.samples_per_pixel, seconds, static_cast<double>(traced->rays) / seconds / 1e6,
      traced->noise);
  return std::move(traced->image);
}

absl::StatusOr<PhotonRenderedImage> GatherPicture(const Intersector& scene, PhotonMapClient& client,
                                                  const PhotonMaps& maps, const Options& options) {
  PhotonRenderOptions render = options.render;
  render.camera.samples_per_pixel =
      options.samples_per_pixel.value_or(render.camera.samples_per_pixel);
  render.camera.seed = options.seed;
  Progress progress("render", std::uint64_t(render.width) * render.height, "pixels");
  render.progress = [&](std::uint64_t pixels) { progress.Update(pixels); };
  return RenderPhotonMaps(scene, client, maps, render);
}

absl::StatusOr<TracedPhotons> TraceScene(const Intersector& scene, const Options& options) {
  Progress progress("trace", options.photon_count + options.caustic_photon_count, "photons");
  return TracePhotons(scene,
                      {.indirect_photons = options.photon_count,
                       .caustic_photons = options.caustic_photon_count,
                       .seed = options.seed,
                       .progress = [&](std::uint64_t photons) { progress.Update(photons); }});
}

absl::StatusOr<UploadedMaps> BuildMaps(PhotonMapClient& client, const TracedPhotons& photons,
                                       const Options& options) {
  Progress progress("upload", photons.indirect.size() + photons.caustic.size(), "photons");
  return UploadMaps(
      client, photons,
      {.name = options.map_name.empty() ? SceneName(options.scene.scene) : options.map_name,
       .time_to_live = options.keep_maps ? std::chrono::milliseconds(0) : kTimeToLive,
       .progress = [&](std::uint64_t sent) { progress.Update(sent); }});
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

/// `finish` gets the picture as soon as there is one: what the server refuses after that is no more
/// than a warning.
absl::Status RenderByPhotons(const Intersector& scene, const Options& options,
                             const GlobalOptions& global,
                             const std::function<absl::Status(const Image&)>& finish) {
  PhotonMapClient client(global.server, global.timeout);
  // Before any work: is there a server?
  if (const auto info = client.GetServerInfo(); !info.ok()) return info.status();

  RenderTimes times;
  const auto begin = Clock::now();
  const auto photons = TraceScene(scene, options);
  if (!photons.ok()) return photons.status();
  times.trace_s = SecondsSince(begin);

  const auto maps = BuildMaps(client, *photons, options);
  if (!maps.ok()) return maps.status();
  times.build_s = maps->seconds;

  const auto render_begin = Clock::now();
  const auto render = GatherPicture(scene, client, maps->refs(), options);
  times.render_s = SecondsSince(render_begin);
  times.whole_s = SecondsSince(begin);
  const absl::Status finished = render.ok() ? finish(render->image) : render.status();
  MapTraversals traversals;
  if (finished.ok()) traversals = SampleTraversals(client, maps->refs(), *render, options.render);
  if (!options.keep_maps) {
    const auto deleted = DeleteMaps(client, maps->refs());
    if (finished.ok() && !deleted.ok())
      Warn(fmt::format("the maps are not deleted: {}", std::string(deleted.message())));
  }
  if (!finished.ok()) return finished;
  fmt::print("{}", FormatRender(*photons, *maps, *render, traversals, times));
  return absl::OkStatus();
}

absl::Status Run(Options options, const GlobalOptions& global) {
  // Before any work: can the picture be written, and is there what it is compared with?
  auto outputs = OpenOutputs(options.output_paths);
  if (!outputs.ok()) return outputs.status();
  std::optional<Image> reference;
  if (!options.compare_path.empty()) {
    auto read = ReadExr(options.compare_path);
    if (!read.ok()) return read.status();
    reference = *std::move(read);
    if (const auto size = Compare(Image(options.render.width, options.render.height), *reference);
        !size.ok()) {
      return size.status();
    }
  }
  auto loaded = LoadChosenScene(options.scene);
  if (!loaded.ok()) return loaded.status();
  options.file.exposure = options.exposure.value_or(loaded->exposure);
  const auto intersector = Intersector::Create(std::move(loaded->scene));
  if (!intersector.ok()) return intersector.status();
  const auto finish = [&](const Image& image) {
    return Finish(image, reference, options, *outputs);
  };
  if (!options.reference) return RenderByPhotons(*intersector, options, global, finish);
  const auto image = RenderReference(*intersector, options);
  return image.ok() ? finish(*image) : image.status();
}

void AddEstimateOptions(CLI::App& command, const std::string& prefix, const std::string& what,
                        EstimateOptions& estimate) {
  command
      .add_option("--" + prefix + "k", estimate.k,
                  "Photons at most in an estimate of " + what + "; 0: all within the radius")
      ->capture_default_str()
      ->check(CLI::Range(0u, kMaxNeighbors));
  command.add_option("--" + prefix + "radius", estimate.radius, "Its largest radius, scene units")
      ->capture_default_str()
      ->check(NumberIn(1e-6, 1e6));
}

void AddPictureOptions(CLI::App& command, Options& options) {
  AddSceneOptions(command, options.scene);
  command.add_option("--width", options.render.width, "Pixels")
      ->capture_default_str()
      ->check(CLI::Range(1, 1 << 14));
  command.add_option("--height", options.render.height, "Pixels")
      ->capture_default_str()
      ->check(CLI::Range(1, 1 << 14));
  command
      .add_option("--spp", options.samples_per_pixel,
                  fmt::format("Samples per pixel (default: {}; {} with --reference)",
                              options.render.camera.samples_per_pixel, kReferenceSamples))
      ->check(CLI::Range(1, 1 << 20));
  command.add_option("--seed", options.seed, "Of all random numbers")
      ->capture_default_str()
      ->check(WithoutSign());
  command
      .add_option("--output", options.output_paths,
                  "Picture, .png (sRGB) or .exr (linear); may be given more than once")
      ->default_str("SCENE.png")
      ->check([](const std::string& path) {
        return IsImagePath(path) ? std::string() : path + " ends neither in .png nor in .exr";
      });
  command.add_option("--exposure", options.exposure, "Of the PNG, stops (default: the scene's)")
      ->check(NumberIn(-100, 100));
  command.add_option("--compare", options.compare_path,
                     "EXR of the same size, to tell the error against");
  command.add_flag("--reference", options.reference, "Path-trace instead: needs no server");
}

void AddPhotonOptions(CLI::App& command, Options& options) {
  command.add_option("--photons", options.photon_count, "Photons of the indirect map; 0: none")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{1'000'000'000}));
  command
      .add_option("--caustic-photons", options.caustic_photon_count,
                  "Photons of the caustic map, where there is something specular; 0: none")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{1'000'000'000}));
  AddEstimateOptions(command, "", "indirect light", options.render.indirect);
  AddEstimateOptions(command, "caustic-", "caustics", options.render.caustic);
  command
      .add_option("--map-name", options.map_name,
                  "The maps are NAME.indirect and NAME.caustic (default: the scene's name)")
      ->check(ServerName());
  command.add_flag(
      "--keep-map", options.keep_maps,
      fmt::format("Leave the maps on the server; else they are deleted at the end, and "
                  "by the server after {} h where that fails",
                  kTimeToLive.count()));
}

}  // namespace

void AddRenderCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("render", "Renders a scene with photon maps of the server");
  AddPictureOptions(*command, *options);
  AddPhotonOptions(*command, *options);
  command->callback([options, &global] {
    if (options->reference && options->samples_per_pixel == 1u) {
      throw CLI::ValidationError("--spp", "a reference needs at least 2, to tell its noise");
    }
    auto& paths = options->output_paths;
    if (paths.empty()) paths = {SceneName(options->scene.scene) + ".png"};
    for (auto path = paths.begin(); path != paths.end(); ++path) {
      if (std::find(paths.begin(), path, *path) != path)
        throw CLI::ValidationError("--output", *path + " is given twice");
    }
    global.action = [options, &global] { return Run(*options, global); };
  });
}

}  // namespace treelight::client
