#include <memory>

#include "client/commands/command.h"
#include "client/commands/output.h"
#include "client/commands/server_option.h"
#include "client/photon_map_client.h"
#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

std::string Count(std::uint64_t count) { return fmt::to_string(count); }

std::string Bytes(std::uint64_t bytes) { return FormatBytes(static_cast<double>(bytes)); }

void PrintInfo(const v1::ServerInfo& info) {
  std::string device = "none";
  for (const v1::Device& candidate : info.devices()) {
    if (candidate.index() == info.device_index())
      device = fmt::format("{} ({})", candidate.name(), candidate.type());
  }
  const v1::ServerLimits& limits = info.limits();
  fmt::print(
      "{}", Format({.head = {},
                    .rows = {{"version", info.version()},
                             {"device", device},
                             {"uptime",
                              fmt::format("{:.1f} s", static_cast<double>(info.uptime_ms()) / 1e3)},
                             {"maps", Count(info.map_count())},
                             {"photons", Count(info.photon_count())},
                             {"device memory used", Bytes(info.device_bytes_used())},
                             {"largest message", Bytes(limits.max_message_bytes())},
                             {"largest chunk", Bytes(limits.max_chunk_bytes())},
                             {"most photons in a map", Count(limits.max_photons())},
                             {"most queries in a batch", Count(limits.max_queries())},
                             {"most neighbours in a batch", Count(limits.max_neighbors())},
                             {"largest k", Count(limits.max_k())},
                             {"largest leaf", Count(limits.max_leaf_size())}}}));
}

}  // namespace

void AddInfoCommand(CLI::App& app, GlobalOptions& global) {
  const auto json = std::make_shared<bool>(false);
  CLI::App* command =
      app.add_subcommand("info", "Tells version, device, load and limits of the server");
  command->add_flag("--json", *json, "As JSON");
  command->callback([json, &global] {
    global.action = [json, &global]() -> absl::Status {
      const auto client = Connect(global);
      if (!client.ok()) return client.status();
      const auto info = (*client)->GetServerInfo();
      if (!info.ok()) return info.status();
      if (*json) return PrintJson(*info);
      PrintInfo(*info);
      return absl::OkStatus();
    };
  });
}

}  // namespace treelight::client
