// treelightd: serves photon maps until SIGTERM or SIGINT.
//
// Exit codes: 0 drained, healthy, or --help; 1 it cannot serve, or does not; 2 wrong command line;
// 130 a signal came before it served, or a second one while it drained.

#include <sys/resource.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <thread>
#include <utility>
#include <variant>

#include "absl/synchronization/mutex.h"
#include "core/keep_memory.h"
#include "fmt/format.h"
#include "google/protobuf/stubs/logging.h"
#include "grpc/support/log.h"
#include "server/address.h"
#include "server/flags.h"
#include "server/folder_check.h"
#include "server/health_check.h"
#include "server/server.h"
#include "server/signal_watch.h"
#include "server/tell.h"
#include "server/tls.h"
#include "server/tokens.h"
#include "server/version.h"
#include "server/warm_up.h"

namespace treelight::server {
namespace {

int Fail(const absl::Status& status, int code) {
  Tell(std::string(status.message()));
  return code;
}

/// Lines of gRPC, and of protobuf, which writes some for each string of a client that is no UTF-8,
/// would stand between ours; GRPC_VERBOSITY brings them back.
void QuietLibraries() {
  if (std::getenv("GRPC_VERBOSITY") != nullptr) return;
  gpr_set_log_function([](gpr_log_func_args*) {});
  google::protobuf::SetLogHandler(nullptr);
}

/// Abseil, as Debian builds it, looks for deadlocks at each lock that gRPC takes; no program in
/// service wants that.
void TrustLibraryLocks() { absl::SetMutexDeadlockDetectionMode(absl::OnDeadlockCycle::kIgnore); }

/// Every connection is an open file, and services start with a limit of 1024 of what they may have.
void RaiseFileLimit() {
  rlimit limit{};
  if (getrlimit(RLIMIT_NOFILE, &limit) != 0) return;
  limit.rlim_cur = limit.rlim_max;
  setrlimit(RLIMIT_NOFILE, &limit);
}

/// `treelightd healthcheck`.
int AnswerHealth(const HealthCheck& check) {
  constexpr std::chrono::seconds kTimeout{5};
  const auto healthy = CheckHealth(check, kTimeout);
  return healthy.ok() ? 0 : Fail(healthy, kExitFailure);
}

/// `treelightd token`.
int AnswerToken(const TokenRequest& request) {
  const auto made = MakeToken(request.name);
  if (!made.ok()) return Fail(made.status(), kExitWrongUsage);
  const auto kept = AppendTokenLine(request.token_file, made->line);
  if (!kept.ok()) return Fail(kept, kExitFailure);
  fmt::print("{}\n", made->token);
  return std::fflush(stdout) == 0 ? 0
                                  : Fail(absl::UnavailableError("stdout is closed"), kExitFailure);
}

/// `treelightd fsck`.
int AnswerFolderCheck(const FolderCheck& check) {
  const auto unsound = CheckFolder(check.data_folder);
  if (!unsound.ok()) return Fail(unsound.status(), kExitFailure);
  return *unsound == 0 ? 0 : kExitFailure;
}

/// What Server::Start would refuse, before the device takes its time.
absl::Status CheckFiles(const ServerOptions& options) {
  if (const auto tls = ReadTlsFiles(options.tls); !tls.ok()) return tls.status();
  return options.token_file.empty() ? absl::OkStatus() : Tokens::Open(options.token_file).status();
}

/// Waits for a signal, then drains.
void ServeUntilSignal(Server& server, SignalWatch& signals, const Flags& flags) {
  signals.BeginServing([&server] {
    const auto reloaded = server.Reload();
    if (!reloaded.ok()) Fail(reloaded, kExitFailure);  // only told: it goes on as it was
  });
  fmt::print("treelightd {} listening on {}, device {}: {}\n", kVersion, server.address(),
             flags.server.device_index, flags.server.devices[flags.server.device_index].name);
  if (server.metrics_port() > 0) {
    fmt::print("treelightd: metrics at http://{}/metrics\n",
               WithPort(flags.server.metrics_listen, server.metrics_port()));
  }
  std::fflush(stdout);
  signals.Wait();
  server.AnnounceEnd();
  std::this_thread::sleep_for(flags.drain_delay);
  const std::size_t cut_off = server.Drain(std::chrono::system_clock::now() + flags.drain);
  signals.EndServing();
  if (cut_off > 0) {
    Tell(fmt::format("{} calls were open after --drain-seconds and were cancelled", cut_off));
  }
}

int Main(int argc, const char* const* argv) {
  static SignalWatch signals(kExitSignal);  // its thread may outlive main()
  std::signal(SIGPIPE, SIG_IGN);  // a reader of the log that goes away must not end the server
  KeepMessageMemory();
  QuietLibraries();
  TrustLibraryLocks();
  RaiseFileLimit();
  auto parsed = ParseFlags(argc, argv);
  if (const auto* exit = std::get_if<Exit>(&parsed)) return exit->code;
  if (const auto* check = std::get_if<HealthCheck>(&parsed)) return AnswerHealth(*check);
  if (const auto* token = std::get_if<TokenRequest>(&parsed)) return AnswerToken(*token);
  if (const auto* check = std::get_if<FolderCheck>(&parsed)) return AnswerFolderCheck(*check);
  Flags& flags = std::get<Flags>(parsed);

  if (auto status = CheckFiles(flags.server); !status.ok()) return Fail(status, kExitFailure);

  // The device; all that the server builds is built on it.
  const auto device = ChooseDevice(flags.device);
  if (!device.ok())
    return Fail(device.status(), flags.device.device.empty() ? kExitFailure : kExitWrongUsage);
  flags.server.devices = ListDevices();
  flags.server.device_index = device->index;
  flags.server.devices[device->index] = *device;  // of several: all their names, the least memory
  auto builder = MakeDeviceBuilder(flags.device);
  if (!builder.ok()) return Fail(builder.status(), kExitFailure);
  if (device->platform != kNativePlatform) {  // which has no kernels to compile
    if (const auto warm = WarmUp(**builder); !warm.ok()) return Fail(warm, kExitFailure);
  }

  auto server = Server::Start(flags.server, *std::move(builder));
  if (!server.ok()) return Fail(server.status(), kExitFailure);
  ServeUntilSignal(**server, signals, flags);
  return 0;
}

}  // namespace
}  // namespace treelight::server

int main(int argc, char** argv) {
  try {
    return treelight::server::Main(argc, argv);
  } catch (const std::exception& error) {  // stdout is full or closed
    treelight::server::Tell(error.what());
    return treelight::server::kExitFailure;
  }
}
