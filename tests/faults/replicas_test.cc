#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <random>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "client/photon_map_client.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/faults/nginx.h"
#include "tests/gated_builder.h"
#include "tests/server_fixture.h"
#include "tests/server_process.h"
#include "tests/temporary_folder.h"

// Three servers on one data folder behind nginx with docker/nginx.conf, all on loopback: one is
// killed, started again and drained while clients gather and build.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;
using client::MapRef;
using client::PhotonMapClient;

constexpr std::size_t kServerCount = 3;
constexpr std::size_t kMapCount = 30;
constexpr int kLoadThreads = 4;
constexpr std::chrono::milliseconds kDrainDelay{2000};

std::string MapName(std::size_t i) { return "map" + std::to_string(i); }

TEST(KubernetesTest, ItsNginxIsThatOfTheFileWithTls) {
  EXPECT_EQ(ManifestConfiguration(), ConfigurationWithTls());
  EXPECT_THAT(ManifestConfiguration(), ::testing::HasSubstr("grpc_ssl_verify on;"));
}

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
    auto client = PhotonMapClient::Connect(nginx_->address(), Connection(), 20s);
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
        "--listen",   address,    "--data-dir",    folder_ + "/maps",
        "--log-file", LogFile(i), "--drain-delay", std::to_string(kDrainDelay / 1s)};
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
  absl::Status Check(PhotonMapClient& client, std::size_t i) const {
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
    using Call = std::function<absl::Status(PhotonMapClient& client, std::size_t map)>;
    Load(const std::string& address, std::chrono::milliseconds patience, Call call)
        : call_(std::move(call)) {
      for (int i = 0; i < kLoadThreads; ++i) {
        threads_.emplace_back([this, address, patience, i](const std::stop_token& stop) {
          PhotonMapClient client(address, 20s);
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
      const auto latest = std::chrono::steady_clock::now() + 60s;
      std::this_thread::sleep_for(500ms);
      while (calls_ < end && std::chrono::steady_clock::now() < latest) {
        std::this_thread::sleep_for(5ms);
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
  Load GatherLoad(std::chrono::milliseconds patience = 10s) {
    return Load(nginx_->address(), patience,
                [this](PhotonMapClient& client, std::size_t map) { return Check(client, map); });
  }

  static inline bool installed_ = false;
  static constexpr GatherOptions kOptions{.k = 5, .outputs = kOutputNeighbors};
  const std::vector<float> positions_ = MakePoints(3, 99);
  TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();
  std::vector<std::string> addresses_;
  std::vector<std::unique_ptr<Process>> servers_;
  std::unique_ptr<Nginx> nginx_;
  std::unique_ptr<PhotonMapClient> client_;
  std::vector<Photons> photons_;
  std::vector<GatherResult> expected_;
};

TEST_F(ReplicasTest, OfAServerThatIsKilledOnlyItsMapsMoveAndTheyComeBack) {
  auto lengths = LogLengths();
  auto load = GatherLoad();
  load.Run();
  const auto before = Owners(lengths);
  ASSERT_EQ(before.size(), kMapCount);
  std::vector<std::size_t> counts(kServerCount);
  for (const auto& [map, owners] : before) {
    EXPECT_EQ(owners.size(), 1u) << map << " was answered by more than one server";
    ++counts[*owners.begin()];
  }
  EXPECT_THAT(counts, ::testing::Each(::testing::Gt(0u)));

  constexpr std::size_t kKilled = 1;
  const int calls_before = load.calls();
  servers_[kKilled]->Signal(SIGKILL);
  servers_[kKilled]->Wait();
  lengths = LogLengths();
  load.Run();
  const auto during = Owners(lengths);
  ASSERT_EQ(during.size(), kMapCount);
  std::string moved;  // one of the maps that moved
  for (const auto& [map, owners] : during) {
    if (*before.at(map).begin() == kKilled) {
      moved = map;
      EXPECT_FALSE(owners.contains(kKilled));
    } else {
      EXPECT_EQ(owners, before.at(map)) << map << " moved from a server that lives";
    }
  }

  // Another server builds what the dead one built before it died, and does it anew.
  const std::size_t which = std::stoul(moved.substr(3));
  const auto repeated = client_->BuildPhotonMap(moved, photons_[which],
                                                {.request_id = "first" + std::to_string(which)});
  ASSERT_TRUE(repeated.ok()) << repeated.status();
  EXPECT_EQ(repeated->map().version(), 1u);
  const auto newer = client_->BuildPhotonMap(moved, photons_[which]);
  ASSERT_TRUE(newer.ok()) << newer.status();
  EXPECT_EQ(newer->map().version(), 2u);
  const auto maps = client_->ListPhotonMaps();
  ASSERT_TRUE(maps.ok());
  EXPECT_EQ(maps->size(), kMapCount + 1);

  Start(kKilled, addresses_[kKilled]);
  ASSERT_EQ(servers_[kKilled]->WaitUntilReadyOrEnded(), addresses_[kKilled]);
  std::this_thread::sleep_for(3s);  // nginx tries it again after 2 s
  lengths = LogLengths();
  load.Run();
  const auto failures = load.End();
  EXPECT_EQ(Owners(lengths), before);
  const auto lines = Log(kKilled, lengths[kKilled]);
  EXPECT_TRUE(std::ranges::any_of(lines, [&](const Line& line) { return line.map == moved; }));
  for (const Line& line : lines) {
    EXPECT_EQ(line.version, line.map == moved ? 2u : 1u) << line.map;
  }
  EXPECT_THAT(failures, ::testing::IsEmpty());
  std::cout << load.calls() << " calls, " << load.calls() - calls_before << " since the kill, "
            << failures.size()
            << " failed; maps of each server: " << ::testing::PrintToString(counts) << "\n";
}

TEST_F(ReplicasTest, ADrainLosesNoAcceptedRequest) {
  constexpr std::size_t kDrained = 2;
  auto lengths = LogLengths();
  auto load = GatherLoad();
  load.Run();
  const auto owners = Owners(lengths);
  lengths = LogLengths();
  const auto owned = std::ranges::find_if(
      owners, [&](const auto& entry) { return entry.second.contains(kDrained); });
  ASSERT_NE(owned, owners.end());
  {
    client::GatherPipeline stream(*client_, MapRef{.name = owned->first}, kOptions);
    const auto answered = [&] {
      const auto sent = stream.Send({.positions = positions_});
      return sent.ok() ? stream.Receive().status() : sent;
    };
    EXPECT_EQ(answered(), absl::OkStatus());
    servers_[kDrained]->Signal(SIGTERM);
    std::this_thread::sleep_for(kDrainDelay / 2);
    EXPECT_EQ(answered(), absl::OkStatus());  // calls are taken still
    std::this_thread::sleep_for(kDrainDelay / 2 + 100ms);
    EXPECT_EQ(answered(), absl::OkStatus());  // no more, but those that are open finish
  }
  EXPECT_EQ(servers_[kDrained]->Wait(), 0);
  std::this_thread::sleep_for(1s);  // of load on those that are left
  const auto failures = load.End();
  EXPECT_THAT(failures, ::testing::IsEmpty());
  EXPECT_THAT(servers_[kDrained]->err(), ::testing::Not(::testing::HasSubstr("cancelled")));
  int accepted = 0, refused = 0;
  for (const Line& line : Log(kDrained, lengths[kDrained])) {
    ++(line.code == "OK" ? accepted : refused);
    EXPECT_THAT(line.code, ::testing::AnyOf("OK", "UNAVAILABLE")) << line.method << line.map;
  }
  EXPECT_GT(accepted, 0);
  std::cout << load.calls() << " calls, " << failures.size()
            << " failed; the drained server: " << accepted << " answered, " << refused
            << " refused and repeated\n";
}

TEST_F(ReplicasTest, AServerThatNginxLeavesOutBeforeItsDrainRefusesNothing) {
  constexpr std::size_t kDrained = 0;
  const auto before = LogLengths();
  auto load = GatherLoad(/*patience=*/0ms);  // what fails is not repeated
  std::this_thread::sleep_for(500ms);        // of load on all
  servers_[kDrained]->Signal(SIGTERM);
  nginx_->TakeOut(kDrained);  // within the drain delay
  EXPECT_EQ(servers_[kDrained]->Wait(), 0);
  std::this_thread::sleep_for(500ms);  // of load on those that are left
  const auto failures = load.End();
  EXPECT_THAT(failures, ::testing::IsEmpty()) << nginx_->err();
  for (const Line& line : Log(kDrained, before[kDrained])) EXPECT_EQ(line.code, "OK");
  std::cout << load.calls() << " calls, " << failures.size() << " failed\n";
}

/// With TLS on both sides of nginx, by the configuration of the manifest, and tokens.
class SecureReplicasTest : public ReplicasTest {
 protected:
  void Prepare() override {
    ASSERT_EQ(
        std::system(("openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 "
                     "-nodes -days 2 -subj /CN=treelight "
                     "-addext subjectAltName=DNS:treelight,IP:127.0.0.1 -keyout " +
                     folder_ + "/tls.key -out " + folder_ + "/tls.crt 2>" + folder_ + "/openssl")
                        .c_str()),
        0)
        << ReadText(folder_ + "/openssl");
    std::filesystem::copy_file(folder_ + "/tls.crt", folder_ + "/ca.crt");
    Process token({"token", "renderer", "--token-file", folder_ + "/tokens"});
    ASSERT_EQ(token.Wait(), 0) << token.err();
    std::ofstream(folder_ + "/renderer.token") << token.out();
  }
  std::vector<std::string> MoreArguments() const override {
    return {"--tls-cert",         folder_ + "/tls.crt", "--tls-key",
            folder_ + "/tls.key", "--token-file",       folder_ + "/tokens"};
  }
  std::string Configuration() const override { return ManifestConfiguration(); }
  client::ConnectionOptions Connection() const override {
    return {.transport = client::Transport::kTls,
            .tls_ca = folder_ + "/ca.crt",
            .token_file = folder_ + "/renderer.token"};
  }
};

TEST_F(SecureReplicasTest, TlsAndTokensWorkThroughNginx) {
  const auto lengths = LogLengths();
  for (std::size_t i = 0; i < kMapCount; ++i) EXPECT_EQ(Check(*client_, i), absl::OkStatus());
  // A log comes a moment after its answers.
  EXPECT_TRUE(Eventually([&] { return Owners(lengths).size() == kMapCount; }));
  for (const auto& [map, owners] : Owners(lengths)) EXPECT_EQ(owners.size(), 1u) << map;
  auto connection = Connection();
  connection.token_file.clear();
  const auto stranger = PhotonMapClient::Connect(nginx_->address(), connection, 20s);
  ASSERT_TRUE(stranger.ok());
  EXPECT_TRUE(absl::IsUnauthenticated(Check(**stranger, 0)));
  auto arguments = MoreArguments();
  arguments.resize(4);
  arguments.insert(arguments.begin(), {"--listen", addresses_[0]});
  arguments.push_back("healthcheck");
  Process health(arguments);  // as the probes do
  EXPECT_EQ(health.Wait(), 0) << health.err();
}

}  // namespace
}  // namespace treelight::testing
