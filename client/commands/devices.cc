#include <memory>
#include <string>

#include "client/commands/command.h"
#include "client/commands/output.h"
#include "client/commands/server_option.h"
#include "client/photon_map_client.h"
#include "client/table.h"
#include "core/builder.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  bool local = false;
  bool json = false;
};

// The devices of this machine, as a server on it would tell them.
v1::ServerInfo LocalDevices() {
  v1::ServerInfo info;
  info.set_device_index(-1);
  for (const DeviceInfo& device : ListDevices()) {
    v1::Device& wire = *info.add_devices();
    wire.set_index(device.index);
    wire.set_name(device.name);
    wire.set_platform(device.platform);
    wire.set_driver(device.driver);
    wire.set_type(device.type);
    wire.set_compute_units(device.compute_units);
    wire.set_memory_bytes(device.memory_bytes);
    wire.set_max_buffer_bytes(device.max_buffer_bytes);
  }
  return info;
}

absl::StatusOr<v1::ServerInfo> ServerDevices(const GlobalOptions& global) {
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  return (*client)->GetServerInfo();
}

void PrintDevices(const v1::ServerInfo& info) {
  Table table{.head = {"", "index", "type", "name", "units", "memory", "largest buffer", "platform",
                       "driver"},
              .rows = {}};
  for (const v1::Device& device : info.devices()) {
    table.rows.push_back({device.index() == info.device_index() ? "*" : "",
                          fmt::to_string(device.index()), device.type(), device.name(),
                          fmt::to_string(device.compute_units()),
                          FormatBytes(static_cast<double>(device.memory_bytes())),
                          FormatBytes(static_cast<double>(device.max_buffer_bytes())),
                          device.platform(), device.driver()});
  }
  fmt::print("{}", Format(table));
}

absl::Status Run(const Options& options, const GlobalOptions& global) {
  absl::StatusOr<v1::ServerInfo> info = options.local ? LocalDevices() : ServerDevices(global);
  if (!info.ok()) return info.status();
  if (options.json) {
    v1::ServerInfo devices;
    devices.set_device_index(info->device_index());
    *devices.mutable_devices() = info->devices();
    return PrintJson(devices);
  }
  PrintDevices(*info);
  return absl::OkStatus();
}

}  // namespace

void AddDevicesCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("devices", "Lists the devices of the server; * marks the one in use");
  command->add_flag("--local", options->local, "Devices of this machine; needs no server");
  command->add_flag("--json", options->json, "As JSON");
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
