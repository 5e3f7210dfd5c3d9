// treelightd with switches that break its promises, one at a time: TREELIGHT_BREAK names it. On the
// CPU builder, which starts at once. Takes the options of treelightd; serves until SIGTERM.

#include <signal.h>

#include <cstdio>
#include <string>
#include <variant>

#include "fmt/format.h"
#include "server/flags.h"
#include "server/server.h"

namespace treelight::server {
namespace {

int Main(int argc, const char* const* argv) {
  sigset_t terminate;
  sigemptyset(&terminate);
  sigaddset(&terminate, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &terminate, nullptr);  // of all threads: they are made later
  signal(SIGPIPE, SIG_IGN);
  auto parsed = ParseFlags(argc, argv);
  if (const auto* exit = std::get_if<Exit>(&parsed)) return exit->code;
  ServerOptions options = std::get<Flags>(parsed).server;
  DeviceInfo cpu;
  cpu.name = cpu.type = "cpu";
  cpu.memory_bytes = cpu.max_buffer_bytes = std::uint64_t{1} << 40;
  options.devices = {cpu};
  const auto server = Server::Start(options, MakeCpuBuilder());
  if (!server.ok()) {
    fmt::print(stderr, "{}\n", std::string(server.status().message()));
    return kExitFailure;
  }
  fmt::print("listening on {}, metrics at http://127.0.0.1:{}/metrics\n", (*server)->address(),
             (*server)->metrics_port());
  std::fflush(stdout);
  int signal = 0;
  sigwait(&terminate, &signal);
  const std::size_t cut_off =
      (*server)->Drain(std::chrono::system_clock::now() + std::get<Flags>(parsed).drain);
  if (cut_off > 0) fmt::print(stderr, "{} calls were open after --drain-seconds\n", cut_off);
  return 0;
}

}  // namespace
}  // namespace treelight::server

int main(int argc, char** argv) { return treelight::server::Main(argc, argv); }
