#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>

#include "CLI/CLI.hpp"
#include "client/commands/command.h"
#include "client/commands/interrupt.h"
#include "client/commands/output.h"
#include "client/commands/server_option.h"
#include "core/keep_memory.h"
#include "fmt/format.h"
#include "grpc/support/log.h"

// The command line client `treelight`.
namespace treelight::client {
namespace {

enum ExitCode {
  kExitOk = 0,
  kExitFailed = 1,
  kExitUsage = 2,
  kExitNoServer = 3,
  kExitInterrupted = 130
};

constexpr char kFooter[] =
    "Exit codes: 0 done; 1 failed; 2 the command line is wrong; 3 no server answers, or it is\n"
    "stopping; 130 load was interrupted and has told what it had.\n"
    "What fails says why in one line on stderr.";

int Fail(int exit_code, const std::string& message) {
  fmt::print(stderr, "treelight: {}\n", OneLine(message));
  return exit_code;
}

/// gRPC's own lines would stand between ours; GRPC_VERBOSITY brings them back.
void QuietGrpc() {
  if (std::getenv("GRPC_VERBOSITY") == nullptr) gpr_set_log_function([](gpr_log_func_args*) {});
}

int Finish(const absl::Status& status, const GlobalOptions& global) {
  const std::string message(status.message());
  if (status.ok()) return kExitOk;
  if (absl::IsCancelled(status) && InterruptGuard::interrupted())
    return Fail(kExitInterrupted, message);
  if (absl::IsDeadlineExceeded(status)) {
    return Fail(kExitFailed, fmt::format("the server took longer than {} ms: {}",
                                         global.timeout.count(), message));
  }
  if (!absl::IsUnavailable(status)) return Fail(kExitFailed, message);
  // A server is there, and the connection is wrong.
  if (message.find("TLS") != std::string::npos ||
      message.find("certificate") != std::string::npos) {
    return Fail(kExitNoServer, fmt::format("{}: {}", global.server, message));
  }
  // The server's own words, and not those of gRPC about a connection.
  if (message.starts_with("the server "))
    return Fail(kExitNoServer, fmt::format("{}: {}", global.server, message));
  return Fail(kExitNoServer, fmt::format("no server answers at {}: {}", global.server, message));
}

int Main(int argc, char** argv) {
  KeepMessageMemory();
  QuietGrpc();
  CLI::App app{"Builds and queries photon maps on a Treelight server.", "treelight"};
  GlobalOptions global;
  AddServerOptions(app, global);
  app.set_version_flag("--version", "treelight " TREELIGHT_VERSION);
  app.require_subcommand(0, 1);  // none is our own error, after one that names a wrong word
  app.fallthrough();
  app.footer(kFooter);
  AddDevicesCommand(app, global);
  AddInfoCommand(app, global);
  AddAccuracyCommand(app, global);
  AddBenchCommand(app, global);
  AddBuildCommand(app, global);
  AddCompareCommand(app, global);
  AddEstimatorsCommand(app, global);
  AddGatherCommand(app, global);
  AddLoadCommand(app, global);
  AddMapsCommand(app, global);
  AddMeasureCommand(app, global);
  AddRebuildCommand(app, global);
  AddRenderCommand(app, global);
  AddStudyCommand(app, global);
  AddTraceCommand(app, global);
  try {
    app.parse(argc, argv);
    if (!global.action) return Fail(kExitUsage, "a subcommand is missing (see treelight --help)");
    absl::Status status = global.action();
    status.Update(FlushStdout());
    return Finish(status, global);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {  // --help, --version
      app.exit(error);
      return Finish(FlushStdout(), global);
    }
    return Fail(kExitUsage, fmt::format("{} (see treelight --help)", error.what()));
  }
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
