#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <string>
#include <thread>
#include <vector>

#include "client/photon_map_client.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/faults/nginx.h"
#include "tests/faults/replicas_fixture.h"
#include "tests/gated_builder.h"
#include "tests/server_process.h"

// Three servers on one data folder behind nginx with docker/nginx.conf, all on loopback: one is
// killed, started again and drained while clients gather and build.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;
using client::MapRef;
using client::PhotonMapClient;

TEST(KubernetesTest, ItsNginxIsThatOfTheFileWithTls) {
  EXPECT_EQ(ManifestConfiguration(), ConfigurationWithTls());
  EXPECT_THAT(ManifestConfiguration(), ::testing::HasSubstr("grpc_ssl_verify on;"));
}

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
  const auto took = nginx_->TakeOut(kDrained);
  EXPECT_EQ(servers_[kDrained]->Wait(), 0);
  std::this_thread::sleep_for(500ms);  // of load on those that are left
  const auto failures = load.End();
  EXPECT_LT(took, kDrainDelay);  // by keepalive_time at the latest
  EXPECT_THAT(failures, ::testing::IsEmpty()) << nginx_->err();
  for (const Line& line : Log(kDrained, before[kDrained])) EXPECT_EQ(line.code, "OK");
  std::cout << load.calls() << " calls, " << failures.size() << " failed; taken out after "
            << took.count() << " ms\n";
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
