#include "server/options.h"

#include "fmt/format.h"
#include "server/address.h"

namespace treelight::server {

namespace {

/// Of an address that may be empty.
absl::Status CheckListen(const std::string& address, bool allow_remote) {
  if (address.empty()) return absl::OkStatus();
  if (auto status = CheckAddress(address); !status.ok()) return status;
  if (IsLocal(address) || allow_remote) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("address '{}' can be reached from other machines, and nothing here is encrypted "
                  "or asks who calls; listen on 127.0.0.1, or say --insecure",
                  address));
}

}  // namespace

absl::Status CheckOptions(const ServerOptions& options) {
  if (options.queue_depth == 0) {
    return absl::InvalidArgumentError("queue depth is 0, it must be at least 1");
  }
  if (options.build_slots == 0) {
    return absl::InvalidArgumentError("build slots are 0, there must be at least 1");
  }
  if (options.stall.count() <= 0) {
    return absl::InvalidArgumentError("the time that a client may stand still must be positive");
  }
  if (!options.devices.empty() &&
      (options.device_index < 0 ||
       static_cast<std::size_t>(options.device_index) >= options.devices.size())) {
    return absl::InvalidArgumentError(fmt::format("device index is {}, there are {} devices",
                                                  options.device_index, options.devices.size()));
  }
  if (options.metrics_listen.starts_with("unix:")) {
    return absl::InvalidArgumentError(
        fmt::format("address '{}' of the metrics is a Unix socket; expected HOST:PORT",
                    options.metrics_listen));
  }
  for (const std::string& address : {options.listen, options.metrics_listen}) {
    if (auto status = CheckListen(address, options.allow_remote); !status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace treelight::server
