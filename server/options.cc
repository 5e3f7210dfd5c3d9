#include "server/options.h"

#include "fmt/format.h"
#include "server/address.h"

namespace treelight::server {

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
  if (options.listen.empty()) return absl::OkStatus();
  if (auto status = CheckAddress(options.listen); !status.ok()) return status;
  if (!IsLocal(options.listen) && !options.allow_remote) {
    return absl::InvalidArgumentError(
        fmt::format("address '{}' can be reached from other machines, and nothing here is "
                    "encrypted or asks who "
                    "calls; listen on 127.0.0.1, or say --insecure",
                    options.listen));
  }
  return absl::OkStatus();
}

}  // namespace treelight::server
