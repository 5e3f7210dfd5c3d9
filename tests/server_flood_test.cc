#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "gtest/gtest.h"
#include "server/file_handle.h"
#include "tests/gated_builder.h"
#include "tests/http2_frames.h"
#include "tests/server_process.h"

// Connections that send what gRPC 1.51 keeps without a bound: the server cuts them, others are
// served, and its memory stays small.
namespace treelight::testing {
namespace {

constexpr double kMiB = 1 << 20;
/// Where nobody cuts: 1.7 GiB of the server's memory, and twice as much as that is.
constexpr std::uint32_t kMostCalls = 60'000;
constexpr double kMostHeadersMiB = 256;
/// What may come before a flood is cut, on a machine that has other things to do.
constexpr double kMostByCallsMiB = 600, kMostByHeadersMiB = 800;
constexpr const char* kInfo = "/treelight.v1.PhotonMapService/GetServerInfo";

/// Memory of a process, MiB.
double ResidentMiB(const Process& process) {
  std::ifstream pages("/proc/" + std::to_string(process.pid()) + "/statm");
  double size = 0, resident = 0;
  pages >> size >> resident;
  return resident * static_cast<double>(sysconf(_SC_PAGESIZE)) / kMiB;
}

/// A connection that sends what it is told.
class Connection {
 public:
  explicit Connection(int port) {
    open_ = http2::Connect(socket_.get(), port);
    Send(http2::Preface() + http2::Frame(http2::kSettings, http2::kAck, 0, ""));
  }

  /// False once the server has closed the connection.
  bool Send(const std::string& bytes) {
    for (std::size_t first = 0; open_ && first < bytes.size();) {
      pollfd ready{.fd = socket_.get(), .events = POLLIN | POLLOUT, .revents = 0};
      poll(&ready, 1, 10'000);
      char buffer[1 << 16];
      if ((ready.revents & (POLLIN | POLLERR | POLLHUP)) != 0 &&
          recv(socket_.get(), buffer, sizeof(buffer), MSG_DONTWAIT) <= 0) {
        open_ = false;
      }
      if (!open_ || (ready.revents & POLLOUT) == 0) continue;
      const ssize_t count = send(socket_.get(), bytes.data() + first, bytes.size() - first,
                                 MSG_NOSIGNAL | MSG_DONTWAIT);
      if (count > 0) first += static_cast<std::size_t>(count);
      if (count < 0 && errno != EAGAIN) open_ = false;
    }
    return open_;
  }

 private:
  const server::FileHandle socket_{socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  bool open_ = false;
};

/// Calls that are reset as soon as they are open, until the server ends that.
void OpenAndReset(Connection& connection, const std::string& path) {
  constexpr std::uint32_t kAtOnce = 200;
  const std::string headers = http2::CallHeaders(path);
  for (std::uint32_t calls = 0; calls < kMostCalls; calls += kAtOnce) {
    std::string bytes;
    for (std::uint32_t i = calls; i < calls + kAtOnce; ++i) {
      bytes += http2::Frame(http2::kHeaders, http2::kEndHeaders, 2 * i + 1, headers);
      bytes += http2::Frame(http2::kReset, 0, 2 * i + 1, http2::Number(8));
    }
    if (!connection.Send(bytes)) return;
  }
}

/// Headers of one call that do not end, until the server ends that; MiB of them.
double SendEndlessHeaders(Connection& connection) {
  std::string fields, bytes;
  for (int i = 0; i < 140; ++i) fields += http2::Field("aaaa", std::string(100, 'b'));
  for (int i = 0; i < 50; ++i) bytes += http2::Frame(http2::kContinuation, 0, 1, fields);
  if (!connection.Send(http2::Frame(http2::kHeaders, 0, 1, http2::CallHeaders(kInfo)))) return 0;
  double sent = 0;
  while (sent < kMostHeadersMiB && connection.Send(bytes)) {
    sent += static_cast<double>(bytes.size()) / kMiB;
  }
  return sent;
}

class ServerFloodTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string address = server_.WaitUntilReady();
    ASSERT_FALSE(address.empty()) << server_.err();
    port_ = std::stoi(address.substr(address.rfind(':') + 1));
    stub_ = treelight::testing::Connect(address);
    before_ = ResidentMiB(server_);
  }
  /// Also where the calls of a connection that was cut are about to end.
  void ExpectAnAnswer() {
    EXPECT_TRUE(Eventually([this] {
      grpc::ClientContext context;
      context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(5));
      v1::ServerInfo info;
      return stub_->GetServerInfo(&context, {}, &info).ok();
    }));
  }
  double Grown() const { return ResidentMiB(server_) - before_; }
  /// It drains, and nothing that was kept holds it up.
  void ExpectTheEndInTime() {
    server_.Signal(SIGTERM);
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_EQ(server_.Wait(), 0);
    EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(10));
  }

  Process server_{
      {"--listen", "127.0.0.1:0", "--memory-limit", "64MiB", "--log-file", "/dev/null"}};
  int port_ = 0;
  std::unique_ptr<v1::PhotonMapService::Stub> stub_;
  double before_ = 0;
};

TEST_F(ServerFloodTest, CallsThatAreOpenedAndResetCostLittle) {
  for (const char* path : {kInfo, "/treelight.v1.PhotonMapService/GatherStream",
                           "/grpc.health.v1.Health/Check", "/no.such/Method"}) {
    Connection flood(port_);
    OpenAndReset(flood, path);  // where the calls end as fast as they come, nobody need be cut
    ASSERT_LT(Grown(), kMostByCallsMiB) << path;
    ExpectAnAnswer();
  }
  ExpectTheEndInTime();
}

TEST_F(ServerFloodTest, HeadersThatDoNotEndCostLittle) {
  std::vector<std::thread> clients;
  for (int i = 0; i < 4; ++i) {
    clients.emplace_back([this] {
      Connection flood(port_);
      EXPECT_LT(SendEndlessHeaders(flood), kMostHeadersMiB);
    });
  }
  for (auto& client : clients) client.join();
  EXPECT_LT(Grown(), kMostByHeadersMiB);
  ExpectAnAnswer();
  ExpectTheEndInTime();
}

}  // namespace
}  // namespace treelight::testing
