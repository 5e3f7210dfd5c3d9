#include "server/options.h"

#include <string_view>

#include "fmt/format.h"
#include "server/address.h"
#include "server/break_switch.h"

namespace treelight::server {

namespace {

/// Whether `address`, which may be empty, is well formed and safe: loopback, a Unix socket, or
/// `guarded`. `remedy` says what else would make it safe.
absl::Status CheckListen(const std::string& address, bool guarded, std::string_view remedy) {
  if (address.empty()) return absl::OkStatus();
  if (auto status = CheckAddress(address); !status.ok()) return status;
  if (IsLocal(address) || guarded || Broken("open_address")) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("address '{}' can be reached from other machines; {}", address, remedy));
}

/// What is wrong with the addresses.
absl::Status CheckAddresses(const ServerOptions& options) {
  const bool guarded = !options.tls.empty() && !options.token_file.empty();
  const auto status =
      CheckListen(options.listen, guarded || options.allow_insecure,
                  options.tls.empty()
                      ? "give --tls-cert, --tls-key and --token-file, listen on 127.0.0.1, or say "
                        "--insecure to serve whoever reaches it"
                      : "give --token-file too, listen on 127.0.0.1, or say --insecure to serve "
                        "whoever reaches it");
  if (!status.ok()) return status;
  if (options.metrics_listen.starts_with("unix:")) {
    return absl::InvalidArgumentError(
        fmt::format("address '{}' of the metrics is a Unix socket; expected HOST:PORT",
                    options.metrics_listen));
  }
  return CheckListen(options.metrics_listen, options.allow_insecure,
                     "the metrics are neither encrypted nor ask who reads them: listen on "
                     "127.0.0.1, or say --insecure");
}

}  // namespace

absl::Status CheckTlsOptions(const TlsFiles& tls) {
  if (tls.certificate.empty() == tls.key.empty() &&
      (tls.client_ca.empty() || !tls.certificate.empty())) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      "TLS needs both --tls-cert and --tls-key, and --tls-client-ca stands beside them");
}

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
  if (options.max_calls == 0) {
    return absl::InvalidArgumentError("open calls are 0, there must be at least 1");
  }
  if (options.max_connections == 0) {
    return absl::InvalidArgumentError("open connections are 0, there must be at least 1");
  }
  if (auto status = CheckTlsOptions(options.tls); !status.ok()) return status;
  return CheckAddresses(options);
}

}  // namespace treelight::server
