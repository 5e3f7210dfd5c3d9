#include <chrono>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "grpc/health/v1/health.grpc.pb.h"
#include "grpcpp/create_channel.h"
#include "gtest/gtest.h"
#include "tests/half_sent_calls.h"
#include "tests/server_process.h"
#include "treelight/v1/photon_map.grpc.pb.h"

// What calls hold of the server's memory whose requests never end, by themselves and all together.
namespace treelight::testing {
namespace {

constexpr std::uint32_t kMessageBytes = 4'000'000;
constexpr double kMiB = 1 << 20;

/// Memory of a process, MiB: "VmRSS:" now, "VmHWM:" the most so far.
double ResidentMiB(const Process& process, const std::string& which = "VmRSS:") {
  std::ifstream status("/proc/" + std::to_string(process.pid()) + "/status");
  for (std::string word; status >> word;) {
    double kibibytes = 0;
    if (word == which && status >> kibibytes) return kibibytes / 1024;
  }
  return 0;
}

int PortOf(const std::string& address) { return std::stoi(address.substr(address.rfind(':') + 1)); }

/// Two seconds of sending.
void Send(const std::vector<std::unique_ptr<HalfSentCalls>>& flood) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  while (std::chrono::steady_clock::now() < end) {
    for (const auto& connection : flood) connection->Go(/*wait_ms=*/1);
  }
}

/// `connections` of `calls` each, after two seconds of sending.
std::vector<std::unique_ptr<HalfSentCalls>> Flood(int port, const std::string& path,
                                                  int connections, int calls) {
  std::vector<std::unique_ptr<HalfSentCalls>> flood;
  for (int i = 0; i < connections; ++i) {
    flood.push_back(std::make_unique<HalfSentCalls>(port, path, calls, kMessageBytes));
  }
  Send(flood);
  return flood;
}

/// Calls of `flood` that the server has ended.
int Ended(const std::vector<std::unique_ptr<HalfSentCalls>>& flood) {
  int ended = 0;
  for (const auto& connection : flood) ended += connection->ended();
  return ended;
}

class ServerHalfSentTest : public ::testing::TestWithParam<const char*> {};

TEST_P(ServerHalfSentTest, CallsOverTheLimitHoldNoRequests) {
  Process server({"--listen", "127.0.0.1:0", "--max-calls", "4", "--log-file", "/dev/null"});
  const std::string address = server.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << server.err();
  const double before = ResidentMiB(server);
  const auto flood =
      Flood(PortOf(address), std::string("/treelight.v1.PhotonMapService/") + GetParam(), 4, 32);
  EXPECT_EQ(Ended(flood), 4 * 32 - 4);
  EXPECT_LT(ResidentMiB(server) - before, 4 * kMessageBytes / kMiB + 40);
}

TEST_P(ServerHalfSentTest, CallsThatAreAdmittedStayWithinTheMemoryLimitAndOthersAreServed) {
  constexpr int kConnections = 4, kCalls = 128;
  constexpr double kLimitMiB = 64, kWindowMiB = 1.0 / 16;
  Process server({"--listen", "127.0.0.1:0", "--memory-limit", "64MiB", "--log-file", "/dev/null"});
  const std::string address = server.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << server.err();
  const double before = ResidentMiB(server);
  const auto flood =
      Flood(PortOf(address), std::string("/treelight.v1.PhotonMapService/") + GetParam(),
            kConnections, kCalls);
  const auto stub = v1::PhotonMapService::NewStub(
      grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
  for (int i = 0; i < 5; ++i) {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
    v1::ServerInfo info;
    const auto status = stub->GetServerInfo(&context, {}, &info);
    EXPECT_TRUE(status.ok()) << status.error_message();
    EXPECT_LE(info.memory_bytes_used(), info.limits().memory_bytes());
    for (const auto& connection : flood) connection->Go(/*wait_ms=*/1);
  }
  EXPECT_LT(ResidentMiB(server) - before, kLimitMiB + kConnections * kCalls * kWindowMiB + 100);
}

TEST(CompressionTest, WhatIsPackedIsRefusedAndNotUnpacked) {
  Process server({"--listen", "127.0.0.1:0", "--log-file", "/dev/null"});
  const std::string address = server.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << server.err();
  const auto channel = grpc::CreateChannel(address, grpc::InsecureChannelCredentials());
  const double before = ResidentMiB(server, "VmHWM:");
  const std::string zeros(200 << 20, '\0');  // 200 KiB on their way
  for (const auto algorithm : {GRPC_COMPRESS_GZIP, GRPC_COMPRESS_DEFLATE}) {
    grpc::ClientContext gather_context, health_context;
    gather_context.set_compression_algorithm(algorithm);
    health_context.set_compression_algorithm(algorithm);
    v1::GatherRequest request;
    request.set_positions(zeros);
    v1::GatherResponse answer;
    const auto gathered =
        v1::PhotonMapService::NewStub(channel)->Gather(&gather_context, request, &answer);
    EXPECT_EQ(gathered.error_code(), grpc::StatusCode::UNIMPLEMENTED) << gathered.error_message();
    grpc::health::v1::HealthCheckRequest check;
    check.set_service(zeros);
    grpc::health::v1::HealthCheckResponse health;
    const auto checked =
        grpc::health::v1::Health::NewStub(channel)->Check(&health_context, check, &health);
    EXPECT_EQ(checked.error_code(), grpc::StatusCode::UNIMPLEMENTED) << checked.error_message();
  }
  EXPECT_LT(ResidentMiB(server, "VmHWM:") - before, 100);
}

/// Health asks for no token, so that its calls are anybody's.
class HealthHalfSentTest : public ::testing::TestWithParam<const char*> {};

TEST_P(HealthHalfSentTest, RequestsThatNeverEndHoldLittleAndProbesAreServed) {
  constexpr int kMaxRequests = 16;
  Process server({"--listen", "127.0.0.1:0", "--log-file", "/dev/null"});
  const std::string address = server.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << server.err();
  const double before = ResidentMiB(server);
  const auto flood =
      Flood(PortOf(address), std::string("/grpc.health.v1.Health/") + GetParam(), 4, 32);
  EXPECT_GE(Ended(flood), 4 * 32 - kMaxRequests);
  EXPECT_LT(ResidentMiB(server) - before, kMaxRequests * kMessageBytes / kMiB + 80);

  // Others come all the time; those that are there are cut off after two seconds.
  const auto health = grpc::health::v1::Health::NewStub(
      grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(3);
  int probes = 0, served = 0;
  while (std::chrono::steady_clock::now() < end) {
    HalfSentCalls more(PortOf(address), std::string("/grpc.health.v1.Health/") + GetParam(), 32,
                       kMessageBytes);
    for (int i = 0; i < 10; ++i) more.Go(/*wait_ms=*/1);
    for (const auto& connection : flood) connection->Go(/*wait_ms=*/0);
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(5));
    grpc::health::v1::HealthCheckResponse response;
    ++probes;
    served += health->Check(&context, {}, &response).ok() ? 1 : 0;
  }
  EXPECT_GT(probes, 10);
  EXPECT_EQ(served, probes);
  EXPECT_EQ(Ended(flood), 4 * 32);
  EXPECT_LT(ResidentMiB(server) - before, kMaxRequests * kMessageBytes / kMiB + 80);
}

TEST(UnreadTest, WhatNoCallReadsStaysWithinItsWindow) {
  constexpr int kConnections = 60, kCalls = 8;
  constexpr double kWindowMiB = 1.0 / 16;
  Process server({"--listen", "127.0.0.1:0", "--log-file", "/dev/null"});
  const std::string address = server.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << server.err();
  const double before = ResidentMiB(server);
  // Calls of health that watch have read the one request that they have.
  std::vector<std::unique_ptr<HalfSentCalls>> flood;
  for (int i = 0; i < kConnections; ++i) {
    flood.push_back(std::make_unique<HalfSentCalls>(PortOf(address), "/grpc.health.v1.Health/Watch",
                                                    kCalls, /*message_bytes=*/0,
                                                    /*sent_bytes=*/8'000'000));
    for (int j = 0; j < 5; ++j) flood.back()->Go(/*wait_ms=*/2);
  }
  Send(flood);
  EXPECT_LT(Ended(flood), kConnections * kCalls);  // some watch
  EXPECT_LT(ResidentMiB(server) - before, kConnections * kCalls * kWindowMiB + 100);
}

INSTANTIATE_TEST_SUITE_P(Methods, HealthHalfSentTest, ::testing::Values("Check", "Watch"),
                         [](const auto& test) { return std::string(test.param); });

TEST(ReflectionHalfSentTest, FewMayBeOpen) {
  constexpr int kMost = 8;
  Process server({"--listen", "127.0.0.1:0", "--log-file", "/dev/null"});
  const std::string address = server.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << server.err();
  const double before = ResidentMiB(server);
  const auto flood = Flood(PortOf(address),
                           "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", 4, 32);
  EXPECT_GE(Ended(flood), 4 * 32 - kMost);
  EXPECT_LT(ResidentMiB(server) - before, kMost * kMessageBytes / kMiB + 40);
}

INSTANTIATE_TEST_SUITE_P(Methods, ServerHalfSentTest,
                         ::testing::Values("Gather", "GatherStream", "BuildPhotonMap",
                                           "RebuildPhotonMap", "GetPhotonMap", "ListPhotonMaps",
                                           "DeletePhotonMap", "GetServerInfo"),
                         [](const auto& test) { return std::string(test.param); });

}  // namespace
}  // namespace treelight::testing
