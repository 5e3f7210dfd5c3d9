#ifndef TREELIGHT_SERVER_FLAGS_H_
#define TREELIGHT_SERVER_FLAGS_H_

#include <chrono>
#include <string>
#include <variant>

#include "core/builder.h"
#include "server/health_check.h"
#include "server/options.h"

namespace treelight::server {

/// What treelightd is told on its command line, in its configuration file and in TREELIGHT_*
/// variables.
struct Flags {
  ServerOptions server;
  DeviceOptions device;
  /// Between NOT_SERVING and the moment from which new calls are refused.
  std::chrono::milliseconds drain_delay{};
  std::chrono::milliseconds drain = std::chrono::seconds(30);  ///< given to open calls at the end
};

/// `treelightd token`: make a token, print it, and add its hash to the file.
struct TokenRequest {
  std::string name, token_file;
};

/// `treelightd fsck`: check the snapshots in the folder.
struct FolderCheck {
  std::string data_folder;
};

/// Nothing is left to do: the process ends with this code.
struct Exit {
  int code = 0;
};

/// Exit codes of treelightd.
inline constexpr int kExitFailure = 1, kExitWrongUsage = 2, kExitSignal = 130;

/// Reads the flags; HealthCheck for `treelightd healthcheck`. Exit where --help or --version was
/// answered (0), or something is wrong, which one line on stderr then tells (kExitWrongUsage). What
/// the command line says goes before the file, the file before the environment.
std::variant<Flags, HealthCheck, TokenRequest, FolderCheck, Exit> ParseFlags(
    int argc, const char* const* argv);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_FLAGS_H_
