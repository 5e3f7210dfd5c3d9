#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "client/commands/build_options.h"
#include "client/commands/build_report.h"
#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/map_option.h"
#include "client/commands/server_option.h"
#include "client/photon_map_client.h"

namespace treelight::client {
namespace {

struct Options {
  MapRef source;
  std::string name;
  BuildChoice build;
  BuildLife life;
  bool json = false;
};

absl::Status Run(const Options& options, const GlobalOptions& global) {
  const RebuildOptions rebuild{.name = options.name,
                               .build = options.build.Options(),
                               .time_to_live = options.life.time_to_live(),
                               .request_id = options.life.request_id};
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto built = (*client)->RebuildPhotonMap(options.source, rebuild);
  if (!built.ok()) return built.status();
  return PrintBuildReport(*built, options.json);
}

}  // namespace

void AddRebuildCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "rebuild", "Builds another map from the photons of one that the server has");
  AddMapOption(*command, "--map", options->source)->required();
  command
      ->add_option("--name", options->name,
                   "Name of the new map (default: a new version of the same name)")
      ->check(ServerName());
  AddBuildOptions(*command, options->build);
  AddBuildLifeOptions(*command, options->life);
  command->add_flag("--json", options->json, "As JSON");
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
