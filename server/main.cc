// treelightd: serves photon maps until SIGTERM or SIGINT.
//
// Exit codes: 0 drained, or --help; 1 it cannot serve; 2 wrong command line; 130 a second signal
// came while it drained.

#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>
#include <utility>
#include <variant>

#include "fmt/format.h"
#include "grpc/support/log.h"
#include "server/flags.h"
#include "server/server.h"
#include "server/version.h"
#include "server/warm_up.h"

namespace treelight::server {
namespace {

int Fail(const absl::Status& status, int code) {
  fmt::print(stderr, "treelightd: {}\n", std::string(status.message()));
  return code;
}

/// Blocks SIGTERM and SIGINT in this thread and those that it will start, so that sigwait() gets
/// them.
sigset_t BlockSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);  // a reader of the log that goes away must not end the server
  return signals;
}

/// gRPC's own lines would stand between ours; GRPC_VERBOSITY brings them back.
void QuietGrpc() {
  if (std::getenv("GRPC_VERBOSITY") == nullptr) gpr_set_log_function([](gpr_log_func_args*) {});
}

/// Waits for a signal, then drains; a second signal ends the process at once.
void ServeUntilSignal(Server& server, const sigset_t& signals, std::chrono::milliseconds drain) {
  int signal = 0;
  sigwait(&signals, &signal);
  std::thread([signals] {
    int second = 0;
    sigwait(&signals, &second);
    std::_Exit(kExitSecondSignal);
  }).detach();
  const std::size_t cut_off = server.Drain(std::chrono::system_clock::now() + drain);
  if (cut_off > 0) {
    fmt::print(stderr, "treelightd: {} calls were open after --drain-seconds and were cancelled\n",
               cut_off);
  }
}

int Main(int argc, const char* const* argv) {
  const sigset_t signals = BlockSignals();
  QuietGrpc();
  auto parsed = ParseFlags(argc, argv);
  if (const auto* exit = std::get_if<Exit>(&parsed)) return exit->code;
  Flags& flags = std::get<Flags>(parsed);

  // The device; all that the server builds is built on it.
  const auto device = ChooseDevice(flags.device);
  if (!device.ok())
    return Fail(device.status(), flags.device.device.empty() ? kExitFailure : kExitWrongUsage);
  flags.server.devices = ListDevices();
  flags.server.device_index = device->index;
  auto builder = MakeDeviceBuilder(flags.device);
  if (!builder.ok()) return Fail(builder.status(), kExitFailure);
  if (const auto warm = WarmUp(**builder); !warm.ok()) return Fail(warm, kExitFailure);

  auto server = Server::Start(flags.server, *std::move(builder));
  if (!server.ok()) return Fail(server.status(), kExitFailure);
  fmt::print("treelightd {} listening on {}, device {}: {}\n", kVersion, (*server)->address(),
             device->index, device->name);
  std::fflush(stdout);
  ServeUntilSignal(**server, signals, flags.drain);
  return 0;
}

}  // namespace
}  // namespace treelight::server

int main(int argc, char** argv) { return treelight::server::Main(argc, argv); }
