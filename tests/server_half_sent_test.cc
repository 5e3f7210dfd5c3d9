#include <chrono>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "gtest/gtest.h"
#include "tests/half_sent_calls.h"
#include "tests/server_process.h"

// What calls hold of the server's memory whose requests never end, by themselves and all together.
namespace treelight::testing {
namespace {

constexpr std::uint32_t kMessageBytes = 4'000'000;
constexpr double kMiB = 1 << 20;

/// Memory of a process, MiB.
double ResidentMiB(const Process& process) {
  std::ifstream status("/proc/" + std::to_string(process.pid()) + "/status");
  for (std::string word; status >> word;) {
    double kibibytes = 0;
    if (word == "VmRSS:" && status >> kibibytes) return kibibytes / 1024;
  }
  return 0;
}

int PortOf(const std::string& address) { return std::stoi(address.substr(address.rfind(':') + 1)); }

/// `connections` of `calls` each, after two seconds of sending.
std::vector<std::unique_ptr<HalfSentCalls>> Flood(int port, const std::string& path,
                                                  int connections, int calls) {
  std::vector<std::unique_ptr<HalfSentCalls>> flood;
  for (int i = 0; i < connections; ++i) {
    flood.push_back(std::make_unique<HalfSentCalls>(port, path, calls, kMessageBytes));
  }
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  while (std::chrono::steady_clock::now() < end) {
    for (const auto& connection : flood) connection->Go(/*wait_ms=*/1);
  }
  return flood;
}

class ServerHalfSentTest : public ::testing::TestWithParam<const char*> {};

TEST_P(ServerHalfSentTest, CallsOverTheLimitHoldNoRequests) {
  Process server({"--listen", "127.0.0.1:0", "--max-calls", "4", "--log-file", "/dev/null"});
  const std::string address = server.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << server.err();
  const double before = ResidentMiB(server);
  const auto flood =
      Flood(PortOf(address), std::string("/treelight.v1.PhotonMapService/") + GetParam(), 4, 32);
  int ended = 0;
  for (const auto& connection : flood) ended += connection->ended();
  EXPECT_EQ(ended, 4 * 32 - 4);
  EXPECT_LT(ResidentMiB(server) - before, 4 * kMessageBytes / kMiB + 40);
}

INSTANTIATE_TEST_SUITE_P(Methods, ServerHalfSentTest,
                         ::testing::Values("Gather", "GatherStream", "BuildPhotonMap",
                                           "RebuildPhotonMap", "GetPhotonMap", "ListPhotonMaps",
                                           "DeletePhotonMap", "GetServerInfo"),
                         [](const auto& test) { return std::string(test.param); });

}  // namespace
}  // namespace treelight::testing
