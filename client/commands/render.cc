#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/commands/command.h"
#include "client/commands/render_report.h"
#include "client/photon_map_client.h"
#include "client/progress.h"
#include "client/render/image_file.h"
#include "client/render/map_upload.h"
#include "client/render/path_tracer.h"
#include "client/render/photon_renderer.h"
#include "client/scenes/registry.h"
#include "client/trace/photon_tracer.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

using Clock = std::chrono::steady_clock;

/// Maps outlive a renderer that was killed by no more than this.
constexpr std::chrono::hours kTimeToLive{1};

constexpr std::uint32_t kReferenceSamples = 256;

struct Options {
  std::string scene = "cornell", map_name, compare_path;
  std::vector<std::string> output_paths;
  std::uint64_t photon_count = 1'000'000, seed = 1;
  std::optional<std::uint32_t> samples_per_pixel;
  PhotonRenderOptions render;
  ImageFileOptions file;
  bool reference = false, keep_maps = false;
};

double SecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Writes the picture to every output and compares it where that was asked for.
absl::Status Finish(const Image& image, const std::optional<Image>& reference,
                    const Options& options) {
  if (reference) {
    const auto error = Compare(image, *reference);
    if (!error.ok()) return error.status();
    fmt::print("{}", FormatError(*error, options.compare_path));
  }
  for (const std::string& path : options.output_paths) {
    if (const auto status = WriteImage(image, path, options.file); !status.ok()) return status;
    fmt::print("picture: {}\n", path);
  }
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
  Progress progress("trace", options.photon_count, "photons");
  return TracePhotons(scene,
                      {.photon_count = options.photon_count,
                       .seed = options.seed,
                       .progress = [&](std::uint64_t photons) { progress.Update(photons); }});
}

absl::StatusOr<UploadedMaps> BuildMaps(PhotonMapClient& client, const TracedPhotons& photons,
                                       const Options& options) {
  Progress progress("upload", photons.indirect.size() + photons.caustic.size(), "photons");
  return UploadMaps(client, photons,
                    {.name = options.map_name.empty() ? options.scene : options.map_name,
                     .time_to_live = options.keep_maps ? std::chrono::milliseconds(0) : kTimeToLive,
                     .progress = [&](std::uint64_t sent) { progress.Update(sent); }});
}

absl::StatusOr<Image> RenderByPhotons(const Intersector& scene, const Options& options,
                                      const GlobalOptions& global) {
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
  auto render = GatherPicture(scene, client, maps->refs(), options);
  times.render_s = SecondsSince(render_begin);
  if (!options.keep_maps) {
    const auto deleted = DeleteMaps(client, maps->refs());
    if (render.ok() && !deleted.ok()) return deleted;
  }
  if (!render.ok()) return render.status();
  times.whole_s = SecondsSince(begin);
  fmt::print("{}", FormatRender(*photons, *maps, *render, times));
  return std::move(render->image);
}

absl::Status Run(const Options& options, const GlobalOptions& global) {
  auto scene = MakeScene(options.scene);
  if (!scene.ok()) return scene.status();
  const auto intersector = Intersector::Create(*std::move(scene));
  if (!intersector.ok()) return intersector.status();
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
  const auto image = options.reference ? RenderReference(*intersector, options)
                                       : RenderByPhotons(*intersector, options, global);
  if (!image.ok()) return image.status();
  return Finish(*image, reference, options);
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
      ->check(CLI::Range(1e-6, 1e6));
}

void AddPictureOptions(CLI::App& command, Options& options) {
  command.add_option("--scene", options.scene, "What is rendered")
      ->capture_default_str()
      ->check(CLI::IsMember(BuiltInScenes()));
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
  command.add_option("--seed", options.seed, "Of all random numbers")->capture_default_str();
  command
      .add_option("--output", options.output_paths,
                  "Picture, .png (sRGB) or .exr (linear); may be given more than once")
      ->default_str("SCENE.png")
      ->check([](const std::string& path) {
        return IsImagePath(path) ? std::string() : path + " ends neither in .png nor in .exr";
      });
  command.add_option("--exposure", options.file.exposure, "Of the PNG, stops")
      ->capture_default_str();
  command.add_option("--compare", options.compare_path,
                     "EXR of the same size, to tell the error against");
  command.add_flag("--reference", options.reference, "Path-trace instead: needs no server");
}

void AddPhotonOptions(CLI::App& command, Options& options) {
  command.add_option("--photons", options.photon_count, "Photons stored, in both maps together")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000'000}));
  AddEstimateOptions(command, "", "indirect light", options.render.indirect);
  AddEstimateOptions(command, "caustic-", "caustics", options.render.caustic);
  command.add_option("--map-name", options.map_name,
                     "The maps are NAME.indirect and NAME.caustic (default: the scene's name)");
  command.add_flag("--keep-map", options.keep_maps, "Leave the maps on the server");
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
    if (options->output_paths.empty()) options->output_paths = {options->scene + ".png"};
    global.action = [options, &global] { return Run(*options, global); };
  });
}

}  // namespace treelight::client
