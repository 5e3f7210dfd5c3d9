#ifndef TREELIGHT_TESTS_FAULTS_REPLICAS_FIXTURE_H_
#define TREELIGHT_TESTS_FAULTS_REPLICAS_FIXTURE_H_

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "client/photon_map_client.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/faults/nginx.h"
#include "tests/server_fixture.h"
#include "tests/server_process.h"
#include "tests/temporary_folder.h"

namespace treelight::testing {

inline constexpr std::size_t kServerCount = 3;
inline constexpr std::size_t kMapCount = 30;
inline constexpr int kLoadThreads = 4;
inline constexpr std::chrono::milliseconds kDrainDelay{3000};

inline std::string MapName(std::size_t i) { return "map" + std::to_string(i); }

/// Three servers on one data folder behind nginx with docker/nginx.conf, all on loopback, with maps
/// that are built.
class ReplicasTest : public ::testing::Test {
 protected:
  /// What a server has logged.
  struct Line {
    std::string method, map, code;
    std::uint64_t version = 0;
  };

  static void SetUpTestSuite() { installed_ = std::system("command -v nginx >/dev/null") == 0; }

  void SetUp() override {
    if (!installed_) {
      std::cerr << "SKIPPED: nginx is not installed (./setup.sh installs it); nothing is known of "
                   "replicas behind it\n";
      GTEST_SKIP() << "nginx is not installed";
    }
    std::filesystem::permissions(folder_, std::filesystem::perms(0755));  // for nginx's workers
    Prepare();
    std::vector<std::string> addresses;
    for (std::size_t i = 0; i < kServerCount; ++i) {
      Start(i, "127.0.0.1:0");
      addresses_.push_back(servers_[i]->WaitUntilReady());
      ASSERT_FALSE(addresses_.back().empty()) << servers_[i]->err();
    }
    nginx_ = std::make_unique<Nginx>(folder_, addresses_, Configuration());
    ASSERT_TRUE(nginx_->WaitUntilReady()) << nginx_->err();
    auto client =
        client::PhotonMapClient::Connect(nginx_->address(), Connection(), std::chrono::seconds(20));
    ASSERT_TRUE(client.ok()) << client.status();
    client_ = *std::move(client);
    for (std::size_t i = 0; i < kMapCount; ++i) {
      photons_.push_back(MakePhotons(200 + 10 * i, static_cast<std::uint32_t>(i)));
      const auto built = client_->BuildPhotonMap(MapName(i), photons_[i],
                                                 {.request_id = "first" + std::to_string(i)});
      ASSERT_TRUE(built.ok()) << built.status() << nginx_->err();
      const auto brute_force = MakeBruteForceBuilder()->Build(photons_[i], {});
      expected_.push_back(*(*brute_force)->Gather({.positions = positions_}, kOptions));
    }
  }

  void TearDown() override {
    nginx_.reset();
    servers_.clear();
  }

  /// What differs where the servers want TLS and tokens.
  virtual void Prepare() {}
  virtual std::vector<std::string> MoreArguments() const { return {}; }
  virtual std::string Configuration() const { return ReadText(TREELIGHT_NGINX_CONF); }
  virtual client::ConnectionOptions Connection() const { return {}; }

  void Start(std::size_t i, const std::string& address) {
    std::vector<std::string> arguments = {
        "--listen",      address,
        "--data-dir",    folder_ + "/maps",
        "--log-file",    LogFile(i),
        "--drain-delay", std::to_string(kDrainDelay / std::chrono::seconds(1))};
    for (const std::string& argument : MoreArguments()) arguments.push_back(argument);
    servers_.resize(kServerCount);
    servers_[i] = std::make_unique<Process>(arguments);
  }
  std::string LogFile(std::size_t i) const { return folder_ + "/log" + std::to_string(i); }

  /// Lines of the log of server `i` from the `first` on.
  std::vector<Line> Log(std::size_t i, std::size_t first = 0) const {
    std::vector<Line> lines;
    std::ifstream file(LogFile(i));
    std::size_t number = 0;
    for (std::string text; std::getline(file, text);) {
      if (number++ < first) continue;
      const auto json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
      if (json.is_discarded()) continue;  // cut off by the kill
      lines.push_back({json.value("method", ""), json.value("map", ""), json.value("code", ""),
                       json.value("version", std::uint64_t{0})});
    }
    return lines;
  }
  std::vector<std::size_t> LogLengths() const {
    std::vector<std::size_t> lengths;
    for (std::size_t i = 0; i < kServerCount; ++i) lengths.push_back(Lines(ReadText(LogFile(i))));
    return lengths;
  }
  /// Which servers have answered for each map since the logs had `lengths`.
  std::map<std::string, std::set<std::size_t>> Owners(
      const std::vector<std::size_t>& lengths) const {
    std::map<std::string, std::set<std::size_t>> owners;
    for (std::size_t i = 0; i < kServerCount; ++i) {
      for (const Line& line : Log(i, lengths[i])) {
        if (line.code == "OK" && !line.map.empty()) owners[line.map].insert(i);
      }
    }
    return owners;
  }

  /// Gathers in map `i` and compares with brute force.
  absl::Status Check(client::PhotonMapClient& client, std::size_t i) const {
    const auto answer = client.Gather({.name = MapName(i)}, {.positions = positions_}, kOptions);
    if (!answer.ok()) return answer.status();
    if (answer->result.neighbor_ids != expected_[i].neighbor_ids ||
        answer->result.neighbor_squared_distances != expected_[i].neighbor_squared_distances) {
      return absl::DataLossError("a wrong answer of " + MapName(i));
    }
    return absl::OkStatus();
  }

  /// Clients that gather in maps by chance, until it goes.
  class Load {
   public:
    using Call = std::function<absl::Status(client::PhotonMapClient& client, std::size_t map)>;
    Load(const std::string& address, std::chrono::milliseconds patience, Call call)
        : call_(std::move(call)) {
      for (int i = 0; i < kLoadThreads; ++i) {
        threads_.emplace_back([this, address, patience, i](const std::stop_token& stop) {
          client::PhotonMapClient client(address, std::chrono::seconds(20));
          client.SetRetryPatience(patience);
          std::mt19937 random(static_cast<unsigned>(i));
          while (!stop.stop_requested()) {
            const auto status = call_(client, random() % kMapCount);
            ++calls_;
            const std::lock_guard lock(mutex_);
            if (!status.ok()) failures_.push_back(status.ToString());
          }
        });
      }
    }
    int calls() const { return calls_; }
    /// Waits until it has made so many more calls that each map was surely asked for.
    void Run() const {
      const int end = calls_ + 25 * static_cast<int>(kMapCount);
      const auto latest = std::chrono::steady_clock::now() + std::chrono::seconds(60);
      std::this_thread::sleep_for(std::chrono::milliseconds(500));
      while (calls_ < end && std::chrono::steady_clock::now() < latest) {
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      }
    }
    /// Ends it; the calls that failed.
    std::vector<std::string> End() {
      for (auto& thread : threads_) thread.request_stop();
      threads_.clear();
      return failures_;
    }

   private:
    const Call call_;
    std::atomic<int> calls_ = 0;
    std::mutex mutex_;
    std::vector<std::string> failures_;  // guarded by mutex_
    std::vector<std::jthread> threads_;
  };
  Load GatherLoad(std::chrono::milliseconds patience = std::chrono::seconds(10)) {
    return Load(
        nginx_->address(), patience,
        [this](client::PhotonMapClient& client, std::size_t map) { return Check(client, map); });
  }

  static inline bool installed_ = false;
  static constexpr GatherOptions kOptions{.k = 5, .outputs = kOutputNeighbors};
  const std::vector<float> positions_ = MakePoints(3, 99);
  TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();
  std::vector<std::string> addresses_;
  std::vector<std::unique_ptr<Process>> servers_;
  std::unique_ptr<Nginx> nginx_;
  std::unique_ptr<client::PhotonMapClient> client_;
  std::vector<Photons> photons_;
  std::vector<GatherResult> expected_;
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_FAULTS_REPLICAS_FIXTURE_H_
