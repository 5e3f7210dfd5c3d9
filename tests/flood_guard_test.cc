#include "server/flood_guard.h"

#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <string>
#include <thread>
#include <vector>

#include "gtest/gtest.h"
#include "server/file_handle.h"

namespace treelight::server {
namespace {

using std::chrono_literals::operator""ms;

constexpr std::uint64_t kMiB = 1 << 20;

/// Both ends of a connection over TCP; the server's is watched.
class FloodGuardTest : public ::testing::Test {
 protected:
  void SetUp() override {
    const FileHandle listening(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t bytes = sizeof(address);
    auto* const any = reinterpret_cast<sockaddr*>(&address);
    ASSERT_EQ(bind(listening.get(), any, bytes), 0);
    ASSERT_EQ(listen(listening.get(), 1), 0);
    ASSERT_EQ(getsockname(listening.get(), any, &bytes), 0);
    client_ = FileHandle(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    ASSERT_EQ(connect(client_.get(), any, bytes), 0);
    server_ = FileHandle(accept4(listening.get(), nullptr, nullptr, SOCK_CLOEXEC));
    ASSERT_EQ(getsockname(client_.get(), any, &bytes), 0);
    peer_ = "ipv4:127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    guard_.Watch(server_.get());
  }

  /// Sends and has the server's end read `bytes`; false where the connection is cut.
  bool Send(std::uint64_t bytes) {
    std::vector<char> buffer(64 << 10);
    for (std::uint64_t sent = 0; sent < bytes; sent += buffer.size()) {
      if (send(client_.get(), buffer.data(), buffer.size(), MSG_NOSIGNAL) < 0) return false;
      for (std::size_t read = 0; read < buffer.size();) {
        const ssize_t count = recv(server_.get(), buffer.data(), buffer.size() - read, 0);
        if (count <= 0) return false;
        read += static_cast<std::size_t>(count);
      }
    }
    return true;
  }

  /// Whether the connection is cut within `time`.
  bool IsCutWithin(std::chrono::milliseconds time) {
    timeval limit{.tv_sec = time.count() / 1000, .tv_usec = time.count() % 1000 * 1000};
    setsockopt(client_.get(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof(limit));
    char byte = 0;
    const ssize_t count = recv(client_.get(), &byte, 1, 0);
    return count == 0 || (count < 0 && errno != EAGAIN);
  }

  FileHandle client_, server_;
  std::string peer_;
  std::atomic<std::uint64_t> accounted_ = 0;
  FloodGuard guard_{{.calls = 20, .own_calls = 5, .bytes = 32 * kMiB},
                    [this] { return accounted_.load(); }};
};

TEST_F(FloodGuardTest, AConnectionWithMoreCallsThanMayBeOpenIsCutWhereThereAreTooMany) {
  std::deque<FloodGuard::Presence> calls, others;
  for (int i = 0; i < 20; ++i)
    calls.emplace_back(guard_, peer_);  // more than its own, not too many
  EXPECT_FALSE(IsCutWithin(200ms));
  calls.clear();
  for (int i = 0; i < 30; ++i) others.emplace_back(guard_, "unix:");
  for (int i = 0; i < 5; ++i)
    calls.emplace_back(guard_, peer_);  // its own, though there are too many
  EXPECT_FALSE(IsCutWithin(200ms));
  calls.emplace_back(guard_, peer_);
  EXPECT_TRUE(IsCutWithin(20'000ms));
}

TEST_F(FloodGuardTest, AConnectionThatCostsMemoryWithoutCallsIsCut) {
  ASSERT_FALSE(IsCutWithin(200ms));  // it has looked
  EXPECT_TRUE(Send(2 * kMiB));
  EXPECT_FALSE(IsCutWithin(200ms));  // and costs nothing
  const std::vector<char> memory(96 * kMiB, 1);
  EXPECT_TRUE(IsCutWithin(20'000ms)) << memory.size();
}

TEST_F(FloodGuardTest, MemoryThatIsAccountedForIsNoFlood) {
  ASSERT_FALSE(IsCutWithin(200ms));
  accounted_ = 1024 * kMiB;  // a sanitizer takes several bytes for one
  const std::vector<char> memory(96 * kMiB, 1);
  EXPECT_TRUE(Send(2 * kMiB));
  EXPECT_FALSE(IsCutWithin(500ms)) << memory.size();
}

TEST_F(FloodGuardTest, WhoSendsMessagesSendsNoFlood) {
  ASSERT_FALSE(IsCutWithin(200ms));
  FloodGuard::Presence call(guard_, peer_);
  const std::vector<char> memory(96 * kMiB, 1);
  const auto end = std::chrono::steady_clock::now() + 500ms;
  while (std::chrono::steady_clock::now() < end) {
    ASSERT_TRUE(Send(kMiB / 2)) << memory.size();
    call.Moved();
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_FALSE(IsCutWithin(200ms));
}

TEST_F(FloodGuardTest, ManyThreadsMayCome) {
  std::vector<std::jthread> threads;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([this] {
      for (int j = 0; j < 500; ++j) FloodGuard::Presence(guard_, peer_).Moved();
    });
  }
  threads.clear();
  EXPECT_FALSE(IsCutWithin(100ms));
}

}  // namespace
}  // namespace treelight::server
