#include <chrono>
#include <cstdlib>
#include <fstream>
#include <string>

#include "gmock/gmock.h"
#include "tests/gated_builder.h"
#include "tests/security_fixture.h"

// Who may call by a token: the program, asked by the client library and by `treelight`.
namespace treelight::testing {
namespace {

using client::ConnectionOptions;
using client::PhotonMapClient;
using std::chrono_literals::operator""s;
using ::testing::HasSubstr;

using ServerTokensTest = SecurityTest;

TEST_F(ServerTokensTest, ATokenOpensEveryCallAndHealthNeedsNone) {
  Process server(WithTokens({"--listen", "127.0.0.1:0"}));
  const std::string address = server.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << server.err();
  const ConnectionOptions known{.token_file = File("renderer")};
  EXPECT_TRUE(Ask(address, known).ok());
  const auto none = Ask(address, {});
  EXPECT_EQ(none.code(), absl::StatusCode::kUnauthenticated);
  EXPECT_THAT(std::string(none.message()), HasSubstr("the call has no token"));
  std::ofstream(File("unknown")) << "tl_AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA\n";
  const auto unknown = Ask(address, {.token_file = File("unknown")});
  EXPECT_EQ(unknown.code(), absl::StatusCode::kUnauthenticated);
  EXPECT_THAT(std::string(unknown.message()), HasSubstr("does not know the token"));

  // Every other kind of call.
  const auto with = PhotonMapClient::Connect(address, known, 20s);
  const auto without = PhotonMapClient::Connect(address, {}, 20s);
  ASSERT_TRUE(with.ok() && without.ok());
  const Photons photons{.positions = {1, 2, 3}, .powers = {}, .directions = {}};
  const GatherQueries queries{.positions = photons.positions};
  const GatherOptions options{.k = 1};
  ASSERT_TRUE((*with)->BuildPhotonMap("map", photons).ok());
  EXPECT_TRUE((*with)->Gather({"map"}, queries, options).ok());
  {  // streams that are open would hold up the end
    client::GatherPipeline opened(**with, {"map"}, options), closed(**without, {"map"}, options);
    EXPECT_TRUE(opened.Send(queries).ok());
    EXPECT_TRUE(opened.Receive().ok());
    absl::Status end = closed.Send(queries);
    if (end.ok()) end = closed.Receive().status();
    EXPECT_EQ(end.code(), absl::StatusCode::kUnauthenticated);
  }
  for (const absl::Status& status :
       {(*without)->BuildPhotonMap("map", photons).status(),
        (*without)->Gather({"map"}, queries, options).status(),
        (*without)->ListPhotonMaps().status(), (*without)->GetPhotonMap({"map"}).status(),
        (*without)->DeletePhotonMap({"map"}).status()}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kUnauthenticated) << status;
  }
  EXPECT_EQ((*with)->ListPhotonMaps()->size(), 1u);

  Process health({"healthcheck", "--listen", address});
  EXPECT_EQ(health.Wait(), 0) << health.err();
  // Reflection would ask nobody.
  const std::string reflection = "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo";
  EXPECT_EQ(CallRaw(address, reflection, std::string("\x3a\x00", 2)).error_code(),
            grpc::StatusCode::UNIMPLEMENTED);
  server.Signal(SIGTERM);
  EXPECT_EQ(server.Wait(), 0);
  EXPECT_THAT(server.err(), HasSubstr("\"client\":\"renderer\""));
  EXPECT_THAT(server.err(), ::testing::Not(HasSubstr("tl_")));  // no token in the log
}

TEST_F(ServerTokensTest, TokensAreTakenUpAndWithdrawnWhileItServes) {
  Process server(WithTokens({"--listen", "127.0.0.1:0"}));
  const std::string address = server.WaitUntilReady();
  AddToken("second");
  AddToken("third");
  EXPECT_TRUE(Eventually([&] { return Ask(address, {.token_file = File("third")}).ok(); }));
  const auto old = PhotonMapClient::Connect(address, {.token_file = File("renderer")}, 20s);
  EXPECT_TRUE((*old)->GetServerInfo().ok());

  // Replaced by one without the first; also for a connection that is open.
  Run("grep -v renderer tokens > new && mv new tokens");
  server.Signal(SIGHUP);
  EXPECT_TRUE(
      Eventually([&] { return absl::IsUnauthenticated((*old)->GetServerInfo().status()); }));
  EXPECT_TRUE(Ask(address, {.token_file = File("second")}).ok());

  // One that everybody could have written waits for that to be mended.
  Run("grep second tokens > new && chmod o+w new && mv new tokens");
  EXPECT_TRUE(
      Eventually([&] { return server.err().find("written by everybody") != std::string::npos; }));
  EXPECT_TRUE(Ask(address, {.token_file = File("third")}).ok());
  Run("chmod o-w tokens");
  EXPECT_TRUE(Eventually(
      [&] { return absl::IsUnauthenticated(Ask(address, {.token_file = File("third")})); }));

  // A file that cannot be read is told once, and the tokens stay.
  Run("echo nonsense > new && mv new tokens");
  EXPECT_TRUE(
      Eventually([&] { return server.err().find("line 1: 1 words") != std::string::npos; }));
  EXPECT_TRUE(Ask(address, {.token_file = File("second")}).ok());
}

TEST_F(ServerTokensTest, ATokenLeavesTheMachineEncryptedOrByOrder) {
  const ConnectionOptions options{.token_file = File("renderer")};
  const auto refused = PhotonMapClient::Connect("192.0.2.1:7543", options);
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(refused.status().message()),
              HasSubstr("the token would go to 192.0.2.1:7543 unencrypted"));
  for (const char* local : {"127.0.0.1:1", "localhost:1", "[::1]:1", "unix:/tmp/x"}) {
    EXPECT_TRUE(PhotonMapClient::Connect(local, options).ok()) << local;
  }
  for (const char* remote : {"127.0.0.1.example.com:1", "localhost.example.com:1", "10.0.0.1:1"}) {
    EXPECT_FALSE(PhotonMapClient::Connect(remote, options).ok()) << remote;
  }
  ConnectionOptions told = options;
  told.send_token_in_plaintext = true;
  EXPECT_TRUE(PhotonMapClient::Connect("192.0.2.1:7543", told).ok());
  ConnectionOptions tls = Tls();
  tls.token_file = File("renderer");
  EXPECT_TRUE(PhotonMapClient::Connect("192.0.2.1:7543", tls).ok());
  std::ofstream(File("two_lines")) << "one\ntwo\n";
  EXPECT_FALSE(PhotonMapClient::Connect("127.0.0.1:1", {.token_file = File("two_lines")}).ok());
}

TEST_F(ServerTokensTest, TokenAndTlsTogetherFromTheEnvironment) {
  Process server(WithTokens(WithTls({"--listen", "127.0.0.1:0"})));
  const std::string address = server.WaitUntilReady();
  std::string err;
  EXPECT_EQ(Treelight(address, "--tls-ca " + File("ca.pem"), err), 1);
  EXPECT_THAT(err, HasSubstr("the call has no token"));
  setenv("TREELIGHT_CLIENT_TLS_CA", File("ca.pem").c_str(), 1);
  setenv("TREELIGHT_CLIENT_TOKEN_FILE", File("renderer").c_str(), 1);
  EXPECT_EQ(Treelight(address, "", err), 0) << err;
  unsetenv("TREELIGHT_CLIENT_TLS_CA");
  unsetenv("TREELIGHT_CLIENT_TOKEN_FILE");
}

}  // namespace
}  // namespace treelight::testing
