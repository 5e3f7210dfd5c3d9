#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "client/commands/build_options.h"
#include "client/commands/build_report.h"
#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/output_names.h"
#include "client/commands/server_option.h"
#include "client/photon_map_client.h"
#include "client/photon_ply.h"
#include "client/progress.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  std::string photons_path, name;
  std::vector<std::string> outputs;
  bool normals = false;
  BuildChoice build;
  BuildLife life;
  bool json = false;
};

/// What is sent of the photons, beside their positions.
PhotonAttributes ChooseAttributes(const Options& options) {
  if (options.outputs.empty()) return {};
  const bool density = (OutputMask(options.outputs) & kOutputDensity) != 0;
  if (options.normals && !density) {
    throw CLI::ValidationError("--normals", "only density reads them: say it in --outputs");
  }
  return {.powers = density, .directions = options.normals};
}

/// Reads the photons. INVALID_ARGUMENT also where the file lacks what the outputs need.
absl::StatusOr<Photons> ReadPhotons(const Options& options) {
  const PhotonAttributes wanted = ChooseAttributes(options);
  auto photons = ReadPhotonPly(options.photons_path, wanted);
  if (!photons.ok() || options.outputs.empty() || photons->size() == 0) return photons;
  if (wanted.powers && photons->powers.empty()) {
    return absl::InvalidArgumentError(
        fmt::format("{}: its photons have no powers, which density needs", options.photons_path));
  }
  if (wanted.directions && photons->directions.empty()) {
    return absl::InvalidArgumentError(fmt::format(
        "{}: its photons have no directions, which normals need", options.photons_path));
  }
  return photons;
}

absl::Status Run(const Options& options, const GlobalOptions& global) {
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto photons = ReadPhotons(options);
  if (!photons.ok()) return photons.status();
  Progress progress("upload", photons->size(), "photons");
  UploadOptions upload{
      .time_to_live = options.life.time_to_live(),
      .request_id = options.life.request_id,
      .progress = [&progress](std::uint64_t photon_count) { progress.Update(photon_count); }};
  upload.build = options.build.Options();
  const auto built = (*client)->BuildPhotonMap(options.name, *photons, upload);
  progress.End();
  if (!built.ok()) return built.status();
  return PrintBuildReport(*built, options.json);
}

}  // namespace

void AddBuildCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("build", "Uploads photons from a PLY file and builds a map over them");
  command
      ->add_option("--photons", options->photons_path,
                   "PLY file: x y z [power_red power_green power_blue] "
                   "[dir_u dir_v | nx ny nz]")
      ->required();
  command->add_option("--name", options->name, "Name of the map: A-Z a-z 0-9 . _ -")
      ->required()
      ->check(ServerName());
  CLI::Option* const outputs =
      command
          ->add_option("--outputs", options->outputs,
                       "What gathers will ask for: count, radius, neighbors, density, statistics, "
                       "error-bound. Powers are sent where density needs them, directions where "
                       "--normals says so (default: all that the file has)")
          ->delimiter(',')
          ->check(CLI::IsMember(OutputNames()));
  command
      ->add_flag("--normals", options->normals,
                 "Queries for densities will have normals, which need directions of photons")
      ->needs(outputs);
  AddBuildOptions(*command, options->build);
  AddBuildLifeOptions(*command, options->life);
  command->add_flag("--json", options->json, "As JSON");
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
