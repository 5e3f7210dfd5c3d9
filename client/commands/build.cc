#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "client/commands/build_options.h"
#include "client/commands/build_report.h"
#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/server_option.h"
#include "client/photon_map_client.h"
#include "client/photon_ply.h"
#include "client/progress.h"

namespace treelight::client {
namespace {

struct Options {
  std::string photons_path, name;
  BuildChoice build;
  BuildLife life;
  bool json = false;
};

absl::Status Run(const Options& options, const GlobalOptions& global) {
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto photons = ReadPhotonPly(options.photons_path);
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
  AddBuildOptions(*command, options->build);
  AddBuildLifeOptions(*command, options->life);
  command->add_flag("--json", options->json, "As JSON");
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
