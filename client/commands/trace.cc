#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/render_report.h"
#include "client/commands/scene_option.h"
#include "client/output_file.h"
#include "client/photon_ply.h"
#include "client/progress.h"
#include "client/trace/photon_tracer.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  SceneChoice scene;
  std::string output_path;
  PhotonTraceOptions trace;
};

template <typename T>
void Append(const std::vector<T>& from, std::vector<T>& to) {
  to.insert(to.end(), from.begin(), from.end());
}

/// Both sets in one: first the indirect photons, then the caustic ones.
Photons AllPhotons(TracedPhotons traced) {
  Photons all = std::move(traced.indirect);
  Append(traced.caustic.positions, all.positions);
  Append(traced.caustic.powers, all.powers);
  Append(traced.caustic.directions, all.directions);
  return all;
}

absl::StatusOr<TracedPhotons> Trace(const Options& options) {
  auto loaded = LoadChosenScene(options.scene);
  if (!loaded.ok()) return loaded.status();
  const auto intersector = Intersector::Create(std::move(loaded->scene));
  if (!intersector.ok()) return intersector.status();
  Progress progress("trace", options.trace.indirect_photons, "photons");
  PhotonTraceOptions trace = options.trace;
  trace.progress = [&](std::uint64_t photons) { progress.Update(photons); };
  return TracePhotons(*intersector, trace);
}

absl::Status Run(const Options& options) {
  auto file = OutputFile::Create(options.output_path);  // before any work: can it be written?
  if (!file.ok()) return file.status();
  auto traced = Trace(options);
  if (!traced.ok()) return traced.status();
  const std::string report =
      fmt::format("photons: {} = {} indirect + {} caustic\n{}",
                  traced->indirect.size() + traced->caustic.size(), traced->indirect.size(),
                  traced->caustic.size(), FormatEnergy(*traced));
  const auto written = WritePhotonPly(*std::move(file), AllPhotons(*std::move(traced)));
  if (!written.ok()) return written;
  fmt::print(options.output_path == "-" ? stderr : stdout, "{}", report);
  return absl::OkStatus();
}

}  // namespace

void AddTraceCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "trace", "Traces photons through a scene into a PLY file; needs no server");
  AddSceneOptions(*command, options->scene);
  command
      ->add_option("--photons", options->trace.indirect_photons,
                   "Photons stored, indirect and caustic together; a few more may come")
      ->capture_default_str()
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000'000}));
  command->add_option("--seed", options->trace.seed, "Of all random numbers")
      ->capture_default_str()
      ->check(WithoutSign());
  command->add_option("--output", options->output_path, "PLY file for the photons; - is stdout")
      ->required();
  command->callback([options, &global] { global.action = [options] { return Run(*options); }; });
}

}  // namespace treelight::client
