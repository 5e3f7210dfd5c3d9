#include "tests/faults/run.h"

#include <algorithm>
#include <csignal>
#include <memory>
#include <optional>
#include <thread>
#include <utility>

#include "fmt/format.h"
#include "tests/faults/board.h"
#include "tests/faults/clients.h"
#include "tests/faults/gate.h"
#include "tests/faults/print.h"
#include "tests/faults/proxy.h"
#include "tests/faults/recorder.h"
#include "tests/faults/server_life.h"
#include "tests/faults/stuck_clients.h"

namespace treelight::faults {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

constexpr std::uint32_t kClients = 4;
constexpr const char* kStall = "1";   // seconds, after which those that stand still go
constexpr const char* kDrain = "10";  // seconds
constexpr const char* kMemoryLimit = "256MiB";
constexpr double kResidentLimit = 1024.0 * (1 << 20);  // that, the OpenCL compiler, the buffers

class Runner {
 public:
  Runner(const RunOptions& options, Disk& disk, const std::string& folder)
      : options_(options),
        disk_(disk),
        folder_(folder),
        random_(options.seed),
        end_(std::chrono::steady_clock::now() + options.length),
        fast_(recorder_, {}),
        slow_(recorder_, {.piece_bytes = 2048, .pause = 2ms}) {
    recorder_.history().resident_limit = kResidentLimit;
  }

  RunReport Run() {
    StartClients();
    int life = 0;
    do {
      if (!LiveOnce(life++)) break;
      for (auto left = random_() % 5; left > 0; --left) DamageAFile();
    } while (violations_.empty() && std::chrono::steady_clock::now() < end_);
    gate_.End();
    fast_.SetServer(0), slow_.SetServer(0);
    for (auto& client : clients_) client.join();
    if (violations_.empty()) LastLook();
    return {std::move(violations_), Summary(), Print(recorder_.history())};
  }

 private:
  void StartClients() {
    for (std::uint32_t i = 0; i < kClients; ++i) {
      clients_.emplace_back([this, i, seed = static_cast<std::uint32_t>(random_())] {
        // The last one asks for much over a slow connection.
        const bool slow = i + 1 == kClients;
        Client client(recorder_, board_, slow ? slow_.address() : fast_.address(),
                      {.seed = seed, .large_batch = slow ? 400u : 0u});
        while (gate_.Enter()) {
          client.Step();
          gate_.Leave();
        }
      });
    }
  }

  std::unique_ptr<ServerLife> StartServer() {
    auto server = std::make_unique<ServerLife>(
        recorder_,
        std::vector<std::string>{options_.server, "--listen", "127.0.0.1:0", "--metrics-listen",
                                 "127.0.0.1:0", "--data-dir", disk_.path(), "--drain-seconds",
                                 kDrain, "--stall-seconds", kStall, "--memory-limit", kMemoryLimit,
                                 "--max-photons", std::to_string(kMaxPhotons), "--log-file",
                                 folder_ + "/log"},
        folder_);
    if (!server->ready()) {
      Judge();
      return nullptr;
    }
    return server;
  }

  /// One server, from its start to its end. False where the run is over.
  bool LiveOnce(int life) {
    const auto server = StartServer();
    if (server == nullptr) return false;
    fast_.SetServer(server->port()), slow_.SetServer(server->port());
    Client auditor(recorder_, board_, fast_.address(),
                   {.seed = static_cast<std::uint32_t>(random_())});
    auditor.Audit();
    {
      const StuckClients stuck(server->port());
      const auto life_end = std::chrono::steady_clock::now() + 1ms * (200 + random_() % 2500);
      while (std::chrono::steady_clock::now() < life_end && !server->Ended()) {
        std::this_thread::sleep_for(1ms * (20 + random_() % 150));
        Disturb();
      }
      if (server->Ended()) {
        Judge();
        return false;
      }
      constexpr int kLivesPerLook = 2;
      if (life % kLivesPerLook == 0) LookWhenQuiet(*server);
      if (life == 1 || random_() % 4 == 0) EndGently(*server);
    }
    server->End(SIGKILL);
    fast_.SetServer(0), slow_.SetServer(0);
    return true;
  }

  void Disturb() {
    switch (random_() % 8) {
      case 0:
      case 1:
      case 2: {
        const std::int64_t bytes = random_() % 2 == 0 ? 1 : 1 + random_() % 60'000;
        (random_() % 4 == 0 ? slow_ : fast_).Cut(random_(), random_() % 2 == 0, bytes);
        break;
      }
      case 3:
        if (disk_.small()) FillDisk();
        break;
      case 4:
        if (random_() % 4 == 0) DamageAFile();
        break;
      default:
        break;
    }
  }

  /// Nearly, so that files can be begun, or wholly.
  void FillDisk() {
    Disturbance full{.start = recorder_.Now()};
    constexpr std::uint64_t kHead = 1 << 20;  // that a build asks for beside its arrays
    disk_.Fill(random_() % 2 == 0 ? kHead + 65'536 : random_() % kHead);
    std::this_thread::sleep_for(1ms * (20 + random_() % 100));
    disk_.Fill(random_() % 40'000);
    std::this_thread::sleep_for(1ms * (20 + random_() % 200));
    disk_.Free();
    full.end = recorder_.Now();
    recorder_.AddFullDisk(full);
  }

  void DamageAFile() {
    const Time start = recorder_.Now();
    auto damage = disk_.DamageOne(random_);
    if (!damage) return;
    damage->start = start;
    damage->end = recorder_.Now();
    recorder_.Add(*std::move(damage));
  }

  /// Lets nobody ask, until the server should hold nothing; then looks at what was.
  void LookWhenQuiet(ServerLife& server) {
    gate_.Close();
    const auto patience = std::chrono::steady_clock::now() + 8s;
    std::optional<Quiet> quiet;
    do {
      std::this_thread::sleep_for(50ms);
      quiet = server.Measure();
    } while (std::chrono::steady_clock::now() < patience && quiet &&
             quiet->open_calls + quiet->open_builds + quiet->queue_depth + quiet->held_bytes > 0);
    if (quiet) recorder_.Add(*quiet);
    Client(recorder_, board_, fast_.address(), {.seed = static_cast<std::uint32_t>(random_())})
        .Audit();
    recorder_.Add(Folder{.at = recorder_.Now(), .files = disk_.Files()});
    // More often than that, the checks would take longer than the run.
    const std::size_t size = recorder_.history().gathers.size();
    if (size > judged_size_ + judged_size_ / 2) {
      judged_size_ = size;
      Judge();
    }
    gate_.Open();
  }

  /// With SIGTERM, while clients ask and some stand still, which the drain waits for.
  static void EndGently(ServerLife& server) {
    const StuckClients stuck(server.port());
    std::this_thread::sleep_for(200ms);
    server.End(SIGTERM);
  }

  /// A last server, asked by one client; then its folder.
  void LastLook() {
    {
      const auto server = StartServer();
      if (server == nullptr) return;
      fast_.SetServer(server->port());
      Client(recorder_, board_, fast_.address(), {.seed = 1}).Audit();
      fast_.SetServer(0);
      server->End(SIGTERM);
    }
    recorder_.Add(Folder{.at = recorder_.Now(), .files = disk_.Files()});
    Judge();
  }

  /// While nobody asks, so that all is written down.
  void Judge() {
    gate_.Close();
    violations_ = Check(recorder_.history());
    gate_.Open();
  }

  std::string Summary() {
    const History& history = recorder_.history();
    const auto lives = [&](int signal) {
      return std::ranges::count(history.lives, signal, &Life::signal);
    };
    const auto answered = [](const auto& calls) {
      using Call = typename std::decay_t<decltype(calls)>::value_type;
      return std::ranges::count(calls, Outcome::kOk, &Call::outcome);
    };
    const auto unknown = [](const auto& calls) {
      using Call = typename std::decay_t<decltype(calls)>::value_type;
      return std::ranges::count(calls, Outcome::kUnknown, &Call::outcome);
    };
    return fmt::format(
        "{} SIGKILL, {} SIGTERM, {} connections cut, {} damaged files, {} full disks; {} builds of "
        "{}, {} gathers of {}, {} deletes of {} answered, {} calls of unknown end, {} lists; {} "
        "looks when quiet",
        lives(SIGKILL), lives(SIGTERM), history.cuts.size(), history.damages.size(),
        history.full_disks.size(), answered(history.builds), history.builds.size(),
        answered(history.gathers), history.gathers.size(), answered(history.deletes),
        history.deletes.size(),
        unknown(history.builds) + unknown(history.gathers) + unknown(history.deletes),
        history.lists.size(), history.quiets.size());
  }

  const RunOptions options_;
  Disk& disk_;
  const std::string folder_;
  std::mt19937 random_;
  const std::chrono::steady_clock::time_point end_;
  Recorder recorder_;
  Proxy fast_, slow_;
  Board board_;
  Gate gate_;
  std::size_t judged_size_ = 0;
  std::vector<Violation> violations_;
  std::vector<std::thread> clients_;
};

}  // namespace

RunReport Run(const RunOptions& options, Disk& disk, const std::string& folder) {
  return Runner(options, disk, folder).Run();
}

}  // namespace treelight::faults
