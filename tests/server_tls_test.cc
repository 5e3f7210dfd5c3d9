#include <chrono>
#include <string>
#include <thread>
#include <utility>

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

class ServerTlsTest : public SecurityTest {
 protected:
  /// A server that asks clients for certificates of the CAs in "clients.pem", at first "ca".
  Process AskForCertificates() const {
    Run("cp ca.pem clients.pem");
    return Process(WithTls({"--listen", "127.0.0.1:0", "--tls-client-ca", File("clients.pem")}));
  }
  /// Tls() with the certificate of `name`.
  ConnectionOptions TlsAs(const std::string& name) const {
    ConnectionOptions options = Tls();
    options.tls_certificate = File(name + ".pem");
    options.tls_key = File(name + ".key");
    return options;
  }
};

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
  EXPECT_EQ(Ask(address, TlsAs("stranger")).code(), absl::StatusCode::kUnavailable);
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

  // A pair that does not match is told and the old one stays; what mends it is taken up.
  Run("cp client.key server.key");
  EXPECT_TRUE(
      Eventually([&] { return server.err().find("is not the key of") != std::string::npos; }));
  EXPECT_THAT(server.err(), HasSubstr("read before stay in use"));
  EXPECT_TRUE(Ask(address, other).ok()) << Ask(address, other);
  MakeCertificate("server", "ca", "IP:127.0.0.1");
  EXPECT_TRUE(Eventually([&] { return Ask(address, Tls()).ok(); }));
}

TEST_F(ServerTlsTest, AClientCaThatChangesIsTakenUp) {
  Process server = AskForCertificates();
  const std::string address = server.WaitUntilReady();
  const ConnectionOptions client = TlsAs("client"), stranger = TlsAs("stranger");
  ASSERT_TRUE(Ask(address, client).ok());
  ASSERT_FALSE(Ask(address, stranger).ok());
  const auto open = PhotonMapClient::Connect(address, client, 20s);
  ASSERT_TRUE((*open)->GetServerInfo().ok());
  Run("cp other_ca.pem clients.new && mv clients.new clients.pem");
  EXPECT_TRUE(Eventually([&] { return Ask(address, stranger).ok(); }));
  EXPECT_EQ(Ask(address, client).code(), absl::StatusCode::kUnavailable);
  EXPECT_TRUE((*open)->GetServerInfo().ok());  // a connection that is open goes on

  // What is no certificate is told, and the old one stays.
  Run("echo junk > clients.new && mv clients.new clients.pem");
  EXPECT_TRUE(
      Eventually([&] { return server.err().find("--tls-client-ca") != std::string::npos; }));
  EXPECT_TRUE(Ask(address, stranger).ok()) << Ask(address, stranger);
  EXPECT_EQ(Ask(address, client).code(), absl::StatusCode::kUnavailable);
}

// What a writer leaves that is no rename: for a moment, or for good where the disk is full.
TEST_F(ServerTlsTest, EmptyFilesChangeNothing) {
  Process server = AskForCertificates();
  const std::string address = server.WaitUntilReady();
  const ConnectionOptions client = TlsAs("client"), stranger = TlsAs("stranger");
  for (const auto& [file, option] : {std::pair{"server.key", "--tls-key"},
                                     {"server.pem", "--tls-cert"},
                                     {"clients.pem", "--tls-client-ca"}}) {
    SCOPED_TRACE(file);
    Run("cp " + std::string(file) + " kept && : > " + file);
    const std::string told = option + (" '" + File(file) + "': holds no ");
    EXPECT_TRUE(Eventually([&] { return server.err().find(told) != std::string::npos; }))
        << server.err();
    EXPECT_TRUE(Ask(address, client).ok()) << Ask(address, client);
    EXPECT_EQ(Ask(address, stranger).code(), absl::StatusCode::kUnavailable);
    Run("cat kept > " + std::string(file));
  }
  // It still looks.
  Run("cat other_ca.pem > clients.pem");
  EXPECT_TRUE(Eventually([&] { return Ask(address, stranger).ok(); })) << server.err();
}

TEST_F(ServerTlsTest, FilesMayBeRewrittenInPlaceWhileClientsConnect) {
  Process server(WithTls({"--listen", "127.0.0.1:0"}));
  const std::string address = server.WaitUntilReady();
  Run("cp server.pem pair.pem && cp server.key pair.key");
  constexpr int kRewrites = 300, kConnections = 100;
  std::jthread writer([&] {
    for (int i = 0; i < kRewrites; ++i) {
      Run("cat pair.pem > server.pem && sleep 0.01 && cat pair.key > server.key");
    }
  });
  for (int i = 0; i < kConnections; ++i) ASSERT_TRUE(Ask(address, Tls()).ok()) << server.err();
  writer.join();
  ASSERT_TRUE(Ask(address, Tls()).ok()) << server.err();
  MakeCertificate("server", "other_ca", "IP:127.0.0.1");
  const ConnectionOptions other{.transport = Transport::kTls, .tls_ca = File("other_ca.pem")};
  EXPECT_TRUE(Eventually([&] { return Ask(address, other).ok(); })) << server.err();
  EXPECT_FALSE(Ask(address, Tls()).ok());
}

TEST_F(ServerTlsTest, AHangUpReadsCertificatesAgain) {
  Process server(WithTls({"--listen", "127.0.0.1:0"}));
  ASSERT_FALSE(server.WaitUntilReady().empty());
  Run("cp client.key server.key");
  ASSERT_TRUE(Eventually([&] { return Lines(server.err()) == 1; })) << server.err();
  server.Signal(SIGHUP);
  EXPECT_TRUE(Eventually([&] { return Lines(server.err()) == 2; })) << server.err();
}

// OpenSSL does not serve with it, which would only show when somebody connects.
TEST_F(ServerTlsTest, AKeyThatIsTooShortIsRefused) {
  Run("openssl req -x509 -newkey rsa:1024 -nodes -keyout server.key -out server.pem -days 2 "
      "-subj /CN=server");
  Process server(WithTls({"--listen", "127.0.0.1:0"}));
  EXPECT_EQ(server.Wait(), 1);
  EXPECT_THAT(server.err(), HasSubstr("--tls-cert '" + File("server.pem") + "': ee key too small"));
}

}  // namespace
}  // namespace treelight::testing
