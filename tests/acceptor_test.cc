#include "server/acceptor.h"

#include <fcntl.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "gtest/gtest.h"
#include "tests/gated_builder.h"
#include "tests/temporary_folder.h"

namespace treelight::testing {
namespace {

using server::Acceptor;
using server::FileHandle;
using server::ListeningSockets;
using server::OpenConnections;

FileHandle NewSocket() { return FileHandle(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)); }

bool Connect(const FileHandle& client, int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return connect(client.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
}

/// Whether the other side has closed the connection; waits for that.
bool IsClosed(const FileHandle& client) {
  char byte = 0;
  return recv(client.get(), &byte, 1, 0) <= 0;
}

/// An acceptor of a free port of loopback that keeps what comes.
class AcceptorTest : public ::testing::Test {
 protected:
  void Start(std::size_t limit) {
    connections_.emplace(limit);
    auto sockets = ListeningSockets::Bind("127.0.0.1:0", 0600);
    ASSERT_TRUE(sockets.ok()) << sockets.status();
    port_ = sockets->port();
    acceptor_.emplace(*std::move(sockets), *connections_, [this](FileHandle connection) {
      const std::lock_guard lock(mutex_);
      taken_.push_back(std::move(connection));
    });
  }
  FileHandle NewClient() {
    FileHandle client = NewSocket();
    EXPECT_TRUE(Connect(client, port_));
    return client;
  }
  std::size_t taken() {
    const std::lock_guard lock(mutex_);
    return taken_.size();
  }
  void CloseTaken() {
    const std::lock_guard lock(mutex_);
    taken_.clear();
  }

  int port_ = 0;
  std::optional<OpenConnections> connections_;

 private:
  std::mutex mutex_;
  std::vector<FileHandle> taken_;  // guarded by mutex_

 protected:
  std::optional<Acceptor> acceptor_;
};

TEST_F(AcceptorTest, WhereThereAreNoFilesLeftItWaitsAndGoesOn) {
  Start(100);
  const FileHandle client = NewSocket();  // before the files run out
  ::testing::internal::CaptureStderr();
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  rlimit few = before;
  few.rlim_cur = 64;
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &few), 0);
  std::vector<FileHandle> files;
  while (true) {
    FileHandle file(dup(client.get()));
    if (file.get() < 0) break;
    files.push_back(std::move(file));
  }
  EXPECT_TRUE(Connect(client, port_));  // the kernel takes it, the server cannot
  usleep(120'000);                      // more than one try
  EXPECT_EQ(taken(), 0u);
  files.clear();
  EXPECT_TRUE(Eventually([&] { return taken() == 1; }));
  EXPECT_EQ(::testing::internal::GetCapturedStderr(),
            "treelightd: 0 connections are open: Too many open files\n");
  setrlimit(RLIMIT_NOFILE, &before);
}

TEST_F(AcceptorTest, MoreThanTheLimitAreClosedUntilSomeHaveGone) {
  Start(3);
  std::vector<FileHandle> clients;
  for (int i = 0; i < 3; ++i) clients.push_back(NewClient());
  ASSERT_TRUE(Eventually([&] { return taken() == 3; }));
  EXPECT_EQ(connections_->open(), 3u);
  EXPECT_TRUE(IsClosed(NewClient()));
  EXPECT_TRUE(IsClosed(NewClient()));
  EXPECT_EQ(taken(), 3u);
  CloseTaken();
  EXPECT_EQ(connections_->open(), 0u);
  EXPECT_TRUE(Eventually([&] {
    clients.push_back(NewClient());
    return taken() > 0;
  }));
}

TEST_F(AcceptorTest, NobodyConnectsOnceItHasGone) {
  Start(3);
  acceptor_.reset();
  EXPECT_FALSE(Connect(NewSocket(), port_));
}

TEST(OpenConnectionsTest, AHandleThatIsUsedAgainIsAnotherConnection) {
  OpenConnections connections(10);
  FileHandle first = NewSocket();
  const int handle = first.get();
  EXPECT_TRUE(connections.Enter(handle));
  EXPECT_EQ(connections.open(), 1u);
  first = FileHandle();
  const FileHandle second = NewSocket();
  ASSERT_EQ(second.get(), handle);
  EXPECT_EQ(connections.open(), 0u);
}

TEST(OpenConnectionsTest, FilesAreKeptForOtherThings) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  for (const auto& [files, connections] : {std::pair{64, 32}, {16, 1}, {1024, 768}, {1025, 769}}) {
    rlimit few = before;
    few.rlim_cur = files;
    ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &few), 0);
    EXPECT_EQ(server::AffordableConnections(4096), connections);
    EXPECT_EQ(server::AffordableConnections(1), 1u);
  }
  setrlimit(RLIMIT_NOFILE, &before);
}

TEST(ListeningSocketsTest, AllInterfacesAreThoseOfIpv4Too) {
  for (const char* listen : {"0.0.0.0:0", "[::]:0", "localhost:0"}) {
    const auto sockets = ListeningSockets::Bind(listen, 0600);
    ASSERT_TRUE(sockets.ok()) << sockets.status();
    EXPECT_TRUE(Connect(NewSocket(), sockets->port())) << listen;
  }
}

TEST(ListeningSocketsTest, WhatCannotBeBoundSaysWhy) {
  const TemporaryFolder folder;
  const auto first = ListeningSockets::Bind("127.0.0.1:0", 0600);
  ASSERT_TRUE(first.ok()) << first.status();
  const std::string taken = "127.0.0.1:" + std::to_string(first->port());
  const std::string file = folder.path() + "/file", path = "/" + std::string(120, 'a');
  ASSERT_GE(FileHandle(open(file.c_str(), O_CREAT | O_WRONLY, 0600)).get(), 0);
  for (const auto& [listen, why] :
       {std::pair<std::string, std::string>{taken, "Address already in use"},
        {"203.0.113.7:0", "Cannot assign requested address"},
        {"unix:" + file, "Address already in use"},
        {"unix:" + path, "the path has 121 characters, at most 107 are possible"}}) {
    const auto sockets = ListeningSockets::Bind(listen, 0600);
    EXPECT_EQ(sockets.status(),
              absl::UnavailableError("cannot listen on '" + listen + "': " + why));
  }
  EXPECT_TRUE(std::filesystem::exists(file));  // only a socket is replaced
}

}  // namespace
}  // namespace treelight::testing
