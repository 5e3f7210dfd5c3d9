#include <chrono>
#include <string>

#include "gmock/gmock.h"
#include "tests/gated_builder.h"
#include "tests/security_fixture.h"

// Who may call by TLS: the program and its certificates, asked by the client library and by
// `treelight`.
namespace treelight::testing {
namespace {

using client::ConnectionOptions;
using client::PhotonMapClient;
using client::Transport;
using std::chrono_literals::operator""s;
using ::testing::HasSubstr;

using ServerTlsTest = SecurityTest;

TEST_F(ServerTlsTest, TlsServesThoseWhoTrustItsCaAndTellsTheOthers) {
  Process server(WithTls({"--listen", "127.0.0.1:0"}));
  const std::string address = server.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << server.err();
  EXPECT_TRUE(Ask(address, Tls()).ok()) << Ask(address, Tls());
  Process health(WithTls({"healthcheck", "--listen", address}));
  EXPECT_EQ(health.Wait(), 0) << health.err();
  Process without({"healthcheck", "--listen", address});
  EXPECT_EQ(without.Wait(), 1);
  EXPECT_THAT(without.err(), HasSubstr("give its --tls-cert and --tls-key"));
  EXPECT_THAT(std::string(Ask(address, {}).message()), HasSubstr("does the server want TLS"));
  EXPECT_THAT(
      std::string(
          Ask(address, {.transport = Transport::kTls, .tls_ca = File("other_ca.pem")}).message()),
      HasSubstr("the server's certificate is of no CA that is trusted here"));
  std::string err;
  EXPECT_EQ(Treelight(address, "--tls-ca " + File("ca.pem"), err), 0) << err;
  EXPECT_EQ(Treelight(address, "--tls-ca " + File("other_ca.pem"), err), 3);
  EXPECT_THAT(err, HasSubstr("of no CA that is trusted here"));
  EXPECT_EQ(Lines(err), 1u) << err;
  EXPECT_EQ(Treelight(address, "--tls-ca " + File("none.pem"), err), 1);
  EXPECT_THAT(err, HasSubstr("CA file '" + File("none.pem") + "': No such file"));

  // The right CA and the wrong name.
  MakeCertificate("server", "ca", "DNS:elsewhere");
  EXPECT_TRUE(Eventually([&] {
    const auto status = Ask(address, Tls());
    return std::string(status.message()).find("is of another host") != std::string::npos;
  })) << Ask(address, Tls())
      << server.err();

  // TLS to a server without.
  Process plain({"--listen", "127.0.0.1:0"});
  EXPECT_THAT(std::string(Ask(plain.WaitUntilReady(), Tls()).message()),
              HasSubstr("the server speaks no TLS"));
}

TEST_F(ServerTlsTest, AClientCaAsksForCertificates) {
  auto arguments = WithTls({"--listen", "127.0.0.1:0"});
  arguments.insert(arguments.end(), {"--tls-client-ca", File("ca.pem")});
  Process server(arguments);
  const std::string address = server.WaitUntilReady();
  ConnectionOptions options = Tls();
  const auto none = Ask(address, options);
  EXPECT_THAT(std::string(none.message()), HasSubstr("or a certificate (--tls-cert)"));
  options.tls_certificate = File("client.pem");
  EXPECT_THAT(std::string(Ask(address, options).message()),
              HasSubstr("a client certificate needs"));
  options.tls_key = File("client.key");
  EXPECT_TRUE(Ask(address, options).ok()) << Ask(address, options);
  options.tls_certificate = File("stranger.pem");
  options.tls_key = File("stranger.key");
  EXPECT_EQ(Ask(address, options).code(), absl::StatusCode::kUnavailable);
  arguments.insert(arguments.begin(), "healthcheck");
  arguments[2] = address;
  Process health(arguments);
  EXPECT_EQ(health.Wait(), 0) << health.err();
}

TEST_F(ServerTlsTest, CertificatesThatChangeAreTakenUp) {
  Process server(WithTls({"--listen", "127.0.0.1:0"}));
  const std::string address = server.WaitUntilReady();
  const auto open = PhotonMapClient::Connect(address, Tls(), 20s);
  ASSERT_TRUE((*open)->GetServerInfo().ok());
  MakeCertificate("server", "other_ca", "IP:127.0.0.1");
  const ConnectionOptions other{.transport = Transport::kTls, .tls_ca = File("other_ca.pem")};
  EXPECT_TRUE(Eventually([&] { return Ask(address, other).ok(); }));
  EXPECT_TRUE((*open)->GetServerInfo().ok());  // a connection that is open goes on

  // A pair that does not match is told, and what mends it is taken up.
  Run("cp client.key server.key");
  EXPECT_TRUE(
      Eventually([&] { return server.err().find("is not the key of") != std::string::npos; }));
  MakeCertificate("server", "ca", "IP:127.0.0.1");
  EXPECT_TRUE(Eventually([&] { return Ask(address, Tls()).ok(); }));
}

TEST_F(ServerTlsTest, AClientCaThatChangesIsTakenUp) {
  Run("cp ca.pem clients.pem");
  auto arguments = WithTls({"--listen", "127.0.0.1:0"});
  arguments.insert(arguments.end(), {"--tls-client-ca", File("clients.pem")});
  Process server(arguments);
  const std::string address = server.WaitUntilReady();
  ConnectionOptions client = Tls(), stranger = Tls();
  client.tls_certificate = File("client.pem"), client.tls_key = File("client.key");
  stranger.tls_certificate = File("stranger.pem"), stranger.tls_key = File("stranger.key");
  ASSERT_TRUE(Ask(address, client).ok());
  ASSERT_FALSE(Ask(address, stranger).ok());
  const auto open = PhotonMapClient::Connect(address, client, 20s);
  ASSERT_TRUE((*open)->GetServerInfo().ok());
  Run("cp other_ca.pem clients.new && mv clients.new clients.pem");
  EXPECT_TRUE(Eventually([&] { return Ask(address, stranger).ok(); }));
  EXPECT_EQ(Ask(address, client).code(), absl::StatusCode::kUnavailable);
  EXPECT_TRUE((*open)->GetServerInfo().ok());  // a connection that is open goes on

  // What is no certificate is told.
  Run("echo junk > clients.new && mv clients.new clients.pem");
  EXPECT_TRUE(
      Eventually([&] { return server.err().find("--tls-client-ca") != std::string::npos; }));
}

}  // namespace
}  // namespace treelight::testing
