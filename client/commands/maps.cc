#include <memory>
#include <string>

#include "client/commands/command.h"
#include "client/commands/map_option.h"
#include "client/commands/map_table.h"
#include "client/commands/output.h"
#include "client/commands/server_option.h"
#include "client/photon_map_client.h"
#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  MapRef map;
  bool json = false;
};

std::string Expiry(const v1::PhotonMap& map) {
  return map.expires_unix_ms() == 0 ? "never" : FormatTime(map.expires_unix_ms());
}

absl::Status List(const Options& options, const GlobalOptions& global) {
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto maps = (*client)->ListPhotonMaps();
  if (!maps.ok()) return maps.status();
  if (options.json) {
    v1::ListPhotonMapsResponse response;
    *response.mutable_maps() = {maps->begin(), maps->end()};
    return PrintJson(response);
  }
  Table table{
      .head = {"name", "version", "photons", "device memory", "created (UTC)", "expires (UTC)"},
      .rows = {}};
  for (const v1::PhotonMap& map : *maps) {
    table.rows.push_back({map.name(), fmt::to_string(map.version()),
                          fmt::to_string(map.photon_count()),
                          FormatBytes(static_cast<double>(map.device_bytes())),
                          FormatTime(map.created_unix_ms()), Expiry(map)});
  }
  fmt::print("{}", Format(table));
  return absl::OkStatus();
}

absl::Status Show(const Options& options, const GlobalOptions& global) {
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto map = (*client)->GetPhotonMap(options.map);
  if (!map.ok()) return map.status();
  if (options.json) return PrintJson(*map);
  fmt::print("{}", FormatMap(*map));
  return absl::OkStatus();
}

absl::Status Delete(const Options& options, const GlobalOptions& global) {
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto deleted = (*client)->DeletePhotonMap(options.map);
  if (!deleted.ok()) return deleted.status();
  fmt::print("deleted {} version{}\n", *deleted, *deleted == 1 ? "" : "s");
  return absl::OkStatus();
}

using Action = absl::Status (*)(const Options&, const GlobalOptions&);

// A subcommand of `maps` that runs `action`.
CLI::App* AddAction(CLI::App& maps, const char* name, const char* description, Action action,
                    const std::shared_ptr<Options>& options, GlobalOptions& global) {
  CLI::App* command = maps.add_subcommand(name, description);
  command->callback([action, options, &global] {
    global.action = [action, options, &global] { return action(*options, global); };
  });
  return command;
}

}  // namespace

void AddMapsCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* maps = app.add_subcommand("maps", "Lists, shows and deletes maps of the server");
  maps->require_subcommand(0, 1);
  maps->fallthrough();
  CLI::App* list = AddAction(*maps, "list", "All versions of all maps", List, options, global);
  CLI::App* show = AddAction(*maps, "show", "One version of a map", Show, options, global);
  CLI::App* remove =
      AddAction(*maps, "delete", "Deletes all versions of NAME, or the one of NAME@VERSION", Delete,
                options, global);
  for (CLI::App* command : {list, show}) command->add_flag("--json", options->json, "As JSON");
  for (CLI::App* command : {show, remove}) AddMapOption(*command, "map", options->map)->required();
}

}  // namespace treelight::client
