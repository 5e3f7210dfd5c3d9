#include <cstdio>
#include <exception>
#include <limits>
#include <string>

#include "CLI/CLI.hpp"
#include "client/commands/command.h"
#include "client/commands/output.h"
#include "fmt/format.h"

// The command line client `treelight`.
namespace treelight::client {
namespace {

enum ExitCode { kExitOk = 0, kExitFailed = 1, kExitUsage = 2, kExitNoServer = 3 };

constexpr char kFooter[] =
    "Exit codes: 0 done; 1 failed; 2 the command line is wrong; 3 no server answers.\n"
    "What fails says why in one line on stderr.";

void AddGlobalOptions(CLI::App& app, GlobalOptions& global) {
  app.add_option("--server", global.server, "Address of treelightd: HOST:PORT or unix:PATH")
      ->envname("TREELIGHT_SERVER")
      ->capture_default_str();
  app.add_option_function<double>(
         "--timeout",
         [&global](double seconds) {
           global.timeout = std::chrono::milliseconds(static_cast<std::int64_t>(seconds * 1000));
         },
         "Seconds that one call to the server may take, at least 0.001 (default: any time)")
      ->check(CLI::Range(0.001, 1e6));
}

int Fail(int exit_code, const std::string& message) {
  fmt::print(stderr, "treelight: {}\n", OneLine(message));
  return exit_code;
}

int Finish(const absl::Status& status, const GlobalOptions& global) {
  const std::string message(status.message());
  if (status.ok()) return kExitOk;
  if (absl::IsDeadlineExceeded(status)) {
    return Fail(kExitFailed, fmt::format("the server took longer than {} ms: {}",
                                         global.timeout.count(), message));
  }
  if (!absl::IsUnavailable(status)) return Fail(kExitFailed, message);
  return Fail(kExitNoServer, fmt::format("no server answers at {}: {}", global.server, message));
}

int Main(int argc, char** argv) {
  CLI::App app{"Builds and queries photon maps on a Treelight server.", "treelight"};
  GlobalOptions global;
  AddGlobalOptions(app, global);
  app.set_version_flag("--version", "treelight " TREELIGHT_VERSION);
  app.require_subcommand(0, 1);  // none is our own error, after one that names a wrong word
  app.fallthrough();
  app.footer(kFooter);
  AddDevicesCommand(app, global);
  AddInfoCommand(app, global);
  AddBuildCommand(app, global);
  AddGatherCommand(app, global);
  AddMapsCommand(app, global);
  AddRenderCommand(app, global);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    return Fail(kExitUsage, fmt::format("{} (see treelight --help)", error.what()));
  }
  if (!global.action) return Fail(kExitUsage, "a subcommand is missing (see treelight --help)");
  return Finish(global.action(), global);
}

}  // namespace
}  // namespace treelight::client

int main(int argc, char** argv) {
  try {
    return treelight::client::Main(argc, argv);
  } catch (const std::exception& error) {  // out of memory, a closed stdout
    std::fprintf(stderr, "treelight: %s\n", error.what());
    return 1;
  }
}
