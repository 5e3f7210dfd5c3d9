#include <algorithm>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/scene_option.h"
#include "client/commands/trace_report.h"
#include "client/output_file.h"
#include "client/photon_ply.h"
#include "client/photon_spool.h"
#include "client/progress.h"
#include "client/render/image_photons.h"
#include "client/trace/photon_tracer.h"
#include "client/trace/targets.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  SceneChoice scene;
  std::string output_path, caustic_path;
  PhotonTraceOptions trace;
  ImagePhotonOptions image;
  bool image_photons = false;
  std::optional<float> albedo;
};

double SecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

absl::StatusOr<Intersector> OpenScene(const Options& options) {
  auto loaded = LoadChosenScene(options.scene);
  if (!loaded.ok()) return loaded.status();
  if (options.albedo) MakeDiffuse(*options.albedo, loaded->scene);
  return Intersector::Create(std::move(loaded->scene));
}

/// A set of photons on its way to a file: its powers are those of one path.
struct SpooledSet {
  PhotonSpool spool;
  PhotonSetReport report{};
};

/// Writes `sets`, one after the other, with powers in W.
absl::Status WriteSets(OutputFile file, const std::vector<SpooledSet*>& sets) {
  PhotonPlyContents contents;
  for (const SpooledSet* set : sets) {
    contents.count += set->report.photons;
    contents.max_power = std::max(contents.max_power, set->report.max_power);
  }
  auto writer = PhotonPlyWriter::Create(std::move(file), contents);
  if (!writer.ok()) return writer.status();
  for (SpooledSet* set : sets) {
    const float share = 1 / static_cast<float>(set->report.paths);
    const auto status = set->spool.Read([&](Photons& block) {
      for (float& power : block.powers) power *= share;
      return writer->Write(block);
    });
    if (!status.ok()) return status;
  }
  return writer->Commit();
}

absl::StatusOr<TraceReport> TraceTo(const Intersector& scene, const Options& options,
                                    SpooledSet& indirect, SpooledSet& caustic) {
  PhotonTraceOptions trace = options.trace;
  const bool has_caustics = !Targets(scene.scene()).empty();
  Progress progress("trace", trace.indirect_photons + (has_caustics ? trace.caustic_photons : 0),
                    "photons");
  trace.progress = [&](std::uint64_t photons) { progress.Update(photons); };
  auto report = TracePhotons(scene, trace, [&](PhotonSet set, const Photons& block) {
    return (set == PhotonSet::kIndirect ? indirect : caustic).spool.Append(block);
  });
  if (!report.ok()) return report.status();
  indirect.report = report->indirect;
  caustic.report = report->caustic;
  return report;
}

/// Where reports go: stdout may be the photons.
std::FILE* ReportFile(const Options& options) {
  return options.output_path == "-" || options.caustic_path == "-" ? stderr : stdout;
}

absl::Status RunPhotons(const Options& options) {
  // Before any work: can it be written?
  auto file = OutputFile::Create(options.output_path);
  if (!file.ok()) return file.status();
  std::optional<OutputFile> caustic_file;
  if (!options.caustic_path.empty()) {
    auto opened = OutputFile::Create(options.caustic_path);
    if (!opened.ok()) return opened.status();
    caustic_file = *std::move(opened);
  }
  const auto scene = OpenScene(options);
  if (!scene.ok()) return scene.status();
  auto indirect_spool = PhotonSpool::Create(), caustic_spool = PhotonSpool::Create();
  if (!indirect_spool.ok()) return indirect_spool.status();
  if (!caustic_spool.ok()) return caustic_spool.status();
  SpooledSet indirect{*std::move(indirect_spool)}, caustic{*std::move(caustic_spool)};

  const auto begin = Clock::now();
  const auto report = TraceTo(*scene, options, indirect, caustic);
  if (!report.ok()) return report.status();
  const double trace_s = SecondsSince(begin);
  const auto status = caustic_file ? WriteSets(*std::move(file), {&indirect})
                                   : WriteSets(*std::move(file), {&indirect, &caustic});
  if (!status.ok()) return status;
  if (caustic_file) {
    if (auto written = WriteSets(*std::move(caustic_file), {&caustic}); !written.ok())
      return written;
  }
  fmt::print(ReportFile(options), "{}", FormatTrace(*report, trace_s));
  return absl::OkStatus();
}

absl::Status RunImagePhotons(const Options& options) {
  auto file = OutputFile::Create(options.output_path);
  if (!file.ok()) return file.status();
  const auto scene = OpenScene(options);
  if (!scene.ok()) return scene.status();
  ImagePhotonOptions image = options.image;
  image.count = options.trace.indirect_photons;
  image.seed = options.trace.seed;
  image.max_bounces = options.trace.max_bounces;
  const auto begin = Clock::now();
  Progress progress("trace", std::uint64_t(image.width) * image.height * image.samples_per_pixel,
                    "paths");
  image.progress = [&](std::uint64_t paths) { progress.Update(paths); };
  auto photons = TraceImagePhotons(*scene, image);
  progress.End();
  if (!photons.ok()) return photons.status();
  const double seconds = SecondsSince(begin);
  const auto written =
      WritePhotonPly(*std::move(file),
                     {.positions = std::move(photons->positions), .powers = {}, .directions = {}});
  if (!written.ok()) return written;
  fmt::print(ReportFile(options),
             "image photons: {}, chosen from {} of {} camera paths\ntime: {:.2f} s, {:.1f} "
             "Mrays/s\n",
             image.count, photons->generated, photons->paths, seconds,
             static_cast<double>(photons->rays) / seconds / 1e6);
  return absl::OkStatus();
}

void AddPhotonOptions(CLI::App& command, Options& options) {
  command
      .add_option("--photons", options.trace.indirect_photons,
                  "Photons of the indirect set, or image photons; a few more may come of the "
                  "former")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{1'000'000'000}));
  command
      .add_option("--caustic-photons", options.trace.caustic_photons,
                  "Photons of the caustic set, where there are mirrors, glass or glossy surfaces")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{1'000'000'000}));
  command
      .add_option("--max-bounces", options.trace.max_bounces,
                  "Scattering events after which a path is cut off")
      ->capture_default_str()
      ->check(CLI::Range(1u, 1'000'000u));
  command
      .add_option("--albedo", options.albedo,
                  "Make every surface diffuse with this reflectance, 0 to 1")
      ->check(NumberIn(0, 1));
  command.add_option("--seed", options.trace.seed, "Of all random numbers")
      ->capture_default_str()
      ->check(WithoutSign());
}

void AddImagePhotonOptions(CLI::App& command, Options& options) {
  CLI::Option* const image = command.add_flag(
      "--image-photons", options.image_photons,
      "Follow paths from the camera instead: positions of diffuse hits, of which --photons are "
      "chosen at random");
  const auto add_size = [&](const char* name, int& size) {
    command.add_option(name, size, "Pixels of the camera, for --image-photons")
        ->capture_default_str()
        ->check(CLI::Range(1, 1 << 14))
        ->needs(image);
  };
  add_size("--width", options.image.width);
  add_size("--height", options.image.height);
  command.add_option("--spp", options.image.samples_per_pixel, "Camera paths through each pixel")
      ->capture_default_str()
      ->check(CLI::Range(1u, 1u << 20))
      ->needs(image);
}

}  // namespace

void AddTraceCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "trace", "Traces photons through a scene into a PLY file; needs no server");
  AddSceneOptions(*command, options->scene);
  AddPhotonOptions(*command, *options);
  AddImagePhotonOptions(*command, *options);
  command
      ->add_option("--output", options->output_path,
                   "PLY file for the photons; - is stdout. First the indirect set, then the "
                   "caustic one")
      ->required();
  command->add_option("--caustic-output", options->caustic_path,
                      "PLY file for the caustic set alone");
  command->callback([options, &global] {
    if (options->trace.indirect_photons == 0 &&
        (options->image_photons || options->trace.caustic_photons == 0)) {
      throw CLI::ValidationError("--photons", "there is nothing to trace");
    }
    if (options->caustic_path == options->output_path)
      throw CLI::ValidationError("--caustic-output", options->caustic_path + " is --output too");
    global.action = [options] {
      return options->image_photons ? RunImagePhotons(*options) : RunPhotons(*options);
    };
  });
}

}  // namespace treelight::client
