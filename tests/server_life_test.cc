#include <chrono>
#include <filesystem>
#include <fstream>

#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "tests/gated_builder.h"
#include "tests/http_get.h"
#include "tests/open_upload.h"
#include "tests/server_fixture.h"
#include "tests/server_process.h"

// From the start to the end of the program, as service managers and containers see it.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

/// Exit code of `treelightd healthcheck` for the server at `address`.
int HealthCheck(const std::string& address) {
  Process check({"healthcheck", "--listen", address});
  return check.Wait();
}

grpc::Status GetInfo(const std::string& address) {
  v1::ServerInfo info;
  grpc::ClientContext context;
  return Connect(address)->GetServerInfo(&context, {}, &info);
}

std::string ReadFile(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

TEST(ServerLifeTest, HealthCheckFollowsTheServer) {
  Process server({"--listen", "127.0.0.1:0", "--drain-delay", "30"});
  const std::string address = server.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << server.err();
  EXPECT_EQ(HealthCheck(address), 0);
  server.Signal(SIGTERM);
  EXPECT_TRUE(Eventually([&] { return HealthCheck(address) == 1; }));
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait(), 130);
  Process check({"healthcheck", "--listen", address});
  EXPECT_EQ(check.Wait(), 1);
  EXPECT_EQ(check.err().find("treelightd: '" + address + "' does not answer: "), 0u) << check.err();
  EXPECT_EQ(Lines(check.err()), 1u);
  Process missing({"healthcheck", "--listen", "unix:" + check.folder() + "/missing"});
  EXPECT_EQ(missing.Wait(), 1);
  EXPECT_NE(missing.err().find("No such file"), std::string::npos) << missing.err();
  EXPECT_EQ(missing.err().find("TLS"), std::string::npos) << missing.err();
}

TEST(ServerLifeTest, HealthCheckAsksTheAddressOfTheEnvironment) {
  Process folder({"--version"});
  const std::string address = "unix:" + folder.folder() + "/socket";
  setenv("TREELIGHT_LISTEN", address.c_str(), 1);
  Process server({});
  Process none({"--version"});
  ASSERT_EQ(server.WaitUntilReady(), address) << server.err();
  Process check({"healthcheck"});
  unsetenv("TREELIGHT_LISTEN");
  EXPECT_EQ(check.Wait(), 0) << check.err();
}

TEST(ServerLifeTest, HealthCheckOfAllInterfacesAsksLoopback) {
  Process server({"--listen", "0.0.0.0:0", "--insecure"});
  const std::string address = server.WaitUntilReady();
  ASSERT_EQ(address.find("0.0.0.0:"), 0u) << address;
  EXPECT_EQ(HealthCheck(address), 0);
}

TEST(ServerLifeTest, CallsAreServedInTheDrainDelayAndRefusedAfterIt) {
  Process server({"--listen", "127.0.0.1:0", "--drain-delay", "1"});
  const std::string address = server.WaitUntilReady();
  const auto signalled = std::chrono::steady_clock::now();
  server.Signal(SIGTERM);
  ASSERT_TRUE(Eventually([&] { return HealthCheck(address) == 1; }));
  if (std::chrono::steady_clock::now() - signalled < 800ms) {
    EXPECT_TRUE(GetInfo(address).ok());
  }
  EXPECT_EQ(server.Wait(), 0);
  EXPECT_GE(std::chrono::steady_clock::now() - signalled, 1s);
  EXPECT_FALSE(GetInfo(address).ok());
}

TEST(ServerLifeTest, WhatIsOpenAfterDrainSecondsIsCutOffAndTold) {
  Process server({"--listen", "127.0.0.1:0", "--drain-seconds", "0.2"});
  const auto stub = Connect(server.WaitUntilReady());
  OpenUpload upload(*stub, MakeUpload("cloud", MakePhotons(10, 1))[0]);
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait(), 0);
  EXPECT_FALSE(upload.Finish().ok());
  EXPECT_NE(server.err().find("1 calls were open after --drain-seconds and were cancelled"),
            std::string::npos)
      << server.err();
}

TEST(ServerLifeTest, WorksAsProcess1) {
  // In a namespace of its own, whose first process ignores signals that it does not take.
  const std::vector<std::string> unshare = {"unshare", "--pid", "--fork"};
  Process server(unshare, {"--listen", "127.0.0.1:0"});
  const std::string address = server.WaitUntilReadyOrEnded();
  if (address.empty()) GTEST_SKIP() << "no namespace can be made here: " << server.err();
  const std::string children = "/proc/" + std::to_string(server.pid()) + "/task/" +
                               std::to_string(server.pid()) + "/children";
  const pid_t first = std::stoi(ReadFile(children));
  const std::string status = ReadFile("/proc/" + std::to_string(first) + "/status");
  ASSERT_NE(status.find("NSpid:\t" + std::to_string(first) + "\t1\n"), std::string::npos) << status;
  kill(first, SIGTERM);
  EXPECT_EQ(server.Wait(), 0);  // unshare ends as its child
}

TEST(ServerLifeTest, SighupOpensTheLogAnew) {
  Process folder({"--version"});
  const std::string log = folder.folder() + "/log", old = log + ".1";
  Process server({"--listen", "127.0.0.1:0", "--log-file", log});
  const std::string address = server.WaitUntilReady();
  ASSERT_TRUE(GetInfo(address).ok());
  ASSERT_TRUE(Eventually([&] { return Lines(ReadFile(log)) == 1; }));
  std::filesystem::rename(log, old);
  ASSERT_TRUE(GetInfo(address).ok());
  ASSERT_TRUE(Eventually([&] { return Lines(ReadFile(old)) == 2; }));  // it has the file still
  server.Signal(SIGHUP);
  ASSERT_TRUE(Eventually([&] { return std::filesystem::exists(log); }));
  ASSERT_TRUE(GetInfo(address).ok());
  EXPECT_TRUE(Eventually([&] { return Lines(ReadFile(log)) == 1; }));
  EXPECT_EQ(Lines(ReadFile(old)), 2u);

  // Where it cannot be opened, that is told and the old file goes on.
  std::filesystem::rename(log, old);
  std::filesystem::create_directory(log);
  server.Signal(SIGHUP);
  ASSERT_TRUE(Eventually([&] { return Lines(server.err()) == 1; }));
  EXPECT_EQ(server.err(), "treelightd: log file '" + log + "': Is a directory\n");
  ASSERT_TRUE(GetInfo(address).ok());
  EXPECT_TRUE(Eventually([&] { return Lines(ReadFile(old)) == 2; }));
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait(), 0);
}

TEST(ServerLifeTest, SighupWithALogOnStderrHasNoEffect) {
  Process server({"--listen", "127.0.0.1:0"});
  const std::string address = server.WaitUntilReady();
  server.Signal(SIGHUP);
  EXPECT_TRUE(GetInfo(address).ok());
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait(), 0);
}

TEST(ServerLifeTest, MetricsHaveAPortOfTheirOwn) {
  Process server({"--listen", "127.0.0.1:0", "--metrics-listen", "127.0.0.1:0"});
  ASSERT_FALSE(server.WaitUntilReady().empty()) << server.err();
  ASSERT_TRUE(Eventually([&] { return Lines(server.out()) == 2; }));
  const std::string line = server.out().substr(server.out().find('\n') + 1);
  const std::string before = "treelightd: metrics at http://127.0.0.1:";
  ASSERT_EQ(line.find(before), 0u) << line;
  const std::string answer = HttpGet(std::stoi(line.substr(before.size())), "/metrics");
  EXPECT_NE(answer.find("treelight_memory_limit_bytes "), std::string::npos) << answer;
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait(), 0);
}

TEST(ServerLifeTest, ExitCodesAreInTheHelp) {
  Process help({"--help"});
  EXPECT_EQ(help.Wait(), 0);
  EXPECT_NE(help.out().find("Exit codes: 0 "), std::string::npos);
}

}  // namespace
}  // namespace treelight::testing
