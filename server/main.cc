// treelightd: serves photon maps until SIGTERM or SIGINT.
//
// Exit codes: 0 drained, or --help; 1 it cannot serve; 2 wrong command line; 130 a signal came
// before it served, or a second one while it drained.

#include <unistd.h>

#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <mutex>
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

/// Takes SIGTERM and SIGINT on a thread of its own. A signal before BeginServing(), while kernels
/// compile say, ends the process at once, as does a second one after it. Lives as long as the
/// process; made before any other thread, as those inherit that the signals are blocked.
class SignalWatch {
 public:
  SignalWatch() {
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGTERM);
    sigaddset(&signals, SIGINT);
    pthread_sigmask(SIG_BLOCK, &signals, nullptr);
    std::thread([this, signals] {
      while (true) {
        int signal = 0;
        sigwait(&signals, &signal);
        const std::lock_guard lock(mutex_);
        // Under the lock: nothing is printed as if the process went on.
        if (!serving_ || signalled_) std::_Exit(kExitSignal);
        signalled_ = true;
        wake_.notify_one();
      }
    }).detach();
  }
  SignalWatch(const SignalWatch&) = delete;
  SignalWatch& operator=(const SignalWatch&) = delete;

  /// From now on the first signal ends Wait() instead of the process.
  void BeginServing() {
    const std::lock_guard lock(mutex_);
    serving_ = true;
  }

  /// Blocks until the first signal.
  void Wait() {
    std::unique_lock lock(mutex_);
    wake_.wait(lock, [this] { return signalled_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable wake_;  // with mutex_: signalled_ became true
  bool serving_ = false;          // guarded by mutex_
  bool signalled_ = false;        // guarded by mutex_
};

/// gRPC's own lines would stand between ours; GRPC_VERBOSITY brings them back.
void QuietGrpc() {
  if (std::getenv("GRPC_VERBOSITY") == nullptr) gpr_set_log_function([](gpr_log_func_args*) {});
}

/// Waits for a signal, then drains.
void ServeUntilSignal(Server& server, SignalWatch& signals, std::chrono::milliseconds drain) {
  signals.Wait();
  const std::size_t cut_off = server.Drain(std::chrono::system_clock::now() + drain);
  if (cut_off > 0) {
    fmt::print(stderr, "treelightd: {} calls were open after --drain-seconds and were cancelled\n",
               cut_off);
  }
}

int Main(int argc, const char* const* argv) {
  static SignalWatch signals;     // its thread may outlive main()
  std::signal(SIGPIPE, SIG_IGN);  // a reader of the log that goes away must not end the server
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
  signals.BeginServing();
  fmt::print("treelightd {} listening on {}, device {}: {}\n", kVersion, (*server)->address(),
             device->index, device->name);
  std::fflush(stdout);
  ServeUntilSignal(**server, signals, flags.drain);
  return 0;
}

}  // namespace
}  // namespace treelight::server

int main(int argc, char** argv) { return treelight::server::Main(argc, argv); }
