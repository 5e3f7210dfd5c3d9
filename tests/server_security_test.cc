#include <sys/stat.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "client/photon_map_client.h"
#include "gmock/gmock.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "gtest/gtest.h"
#include "tests/gated_builder.h"
#include "tests/server_process.h"
#include "tests/temporary_folder.h"

// Who may call, and how: the program with TLS and tokens, asked by the client library and by
// `treelight`.
namespace treelight::testing {
namespace {

using client::ConnectionOptions;
using client::PhotonMapClient;
using client::Transport;
using std::chrono_literals::operator""s;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

/// A folder with a CA, certificates of it, a second CA, and a token.
class ServerSecurityTest : public ::testing::Test {
 protected:
  ServerSecurityTest() {
    MakeCa("ca");
    MakeCa("other_ca");
    MakeCertificate("server", "ca", "DNS:localhost,IP:127.0.0.1");
    MakeCertificate("client", "ca", "DNS:client");
    MakeCertificate("stranger", "other_ca", "DNS:stranger");
    AddToken("renderer");
  }

  std::string File(const std::string& name) const { return folder_ + "/" + name; }

  void Run(const std::string& command) const {
    ASSERT_EQ(std::system(("cd " + folder_ + " && " + command + " 2>>log").c_str()), 0) << command;
  }
  void MakeCa(const std::string& name) const {
    Run("openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -keyout " +
        name + ".key -out " + name + ".pem -days 2 -subj /CN=" + name);
  }
  void MakeCertificate(const std::string& name, const std::string& ca,
                       const std::string& alternatives) const {
    std::ofstream(File(name + ".ext")) << "subjectAltName=" << alternatives << "\n";
    Run("openssl req -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -keyout " + name +
        ".key -out " + name + ".csr -subj /CN=" + name);
    Run("openssl x509 -req -in " + name + ".csr -CA " + ca + ".pem -CAkey " + ca +
        ".key -CAcreateserial -out " + name + ".pem -days 2 -extfile " + name + ".ext");
  }
  /// Adds a token for `name` to the file "tokens"; the token goes to a file of that name.
  void AddToken(const std::string& name) const {
    Process token({"token", name, "--token-file", File("tokens")});
    ASSERT_EQ(token.Wait(), 0) << token.err();
    std::ofstream(File(name)) << token.out();
  }

  std::vector<std::string> WithTls(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(),
                     {"--tls-cert", File("server.pem"), "--tls-key", File("server.key")});
    return arguments;
  }
  std::vector<std::string> WithTokens(std::vector<std::string> arguments) const {
    arguments.insert(arguments.end(), {"--token-file", File("tokens")});
    return arguments;
  }
  ConnectionOptions Tls() const { return {.transport = Transport::kTls, .tls_ca = File("ca.pem")}; }

  /// How GetServerInfo ends.
  static absl::Status Ask(const std::string& address, const ConnectionOptions& options) {
    const auto client = PhotonMapClient::Connect(address, options, 20s);
    if (!client.ok()) return client.status();
    return (*client)->GetServerInfo().status();
  }
  /// Exit code of `treelight info`; `err` is what it says on stderr, one line.
  int Treelight(const std::string& address, const std::string& options, std::string& err) const {
    const int status = std::system((std::string(TREELIGHT) + " --server " + address + " " +
                                    options + " info >" + File("out") + " 2>" + File("err"))
                                       .c_str());
    std::ostringstream text;
    text << std::ifstream(File("err")).rdbuf();
    err = text.str();
    return WEXITSTATUS(status);
  }

  /// How a call of `method` with `bytes` as its only message ends.
  static grpc::Status CallRaw(const std::string& address, const std::string& method,
                              const std::string& bytes) {
    grpc::GenericStub stub(grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
    grpc::ClientContext context;
    grpc::CompletionQueue queue;
    const grpc::Slice slice(bytes);
    const auto call = stub.PrepareUnaryCall(&context, method, grpc::ByteBuffer(&slice, 1), &queue);
    call->StartCall();
    grpc::ByteBuffer response;
    grpc::Status status;
    call->Finish(&response, &status, nullptr);
    void* tag = nullptr;
    bool ok = false;
    queue.Next(&tag, &ok);
    return status;
  }

  TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();
};

TEST_F(ServerSecurityTest, AnAddressForOthersNeedsTlsAndTokensOrInsecure) {
  const std::vector<std::string> everywhere = {"--listen", "0.0.0.0:0"};
  for (const auto& [arguments, remedy] :
       {std::pair{everywhere, "give --tls-cert, --tls-key and --token-file"},
        std::pair{WithTokens(everywhere), "give --tls-cert, --tls-key and --token-file"},
        std::pair{WithTls(everywhere), "give --token-file too"}}) {
    Process refused(arguments);
    EXPECT_EQ(refused.Wait(), 2);
    EXPECT_THAT(refused.err(),
                AllOf(StartsWith("treelightd: address '0.0.0.0:0' can be reached from other "
                                 "machines; "),
                      HasSubstr(remedy), HasSubstr("--insecure")));
  }
  Process guarded(WithTokens(WithTls(everywhere)));
  const std::string address = guarded.WaitUntilReady();
  EXPECT_THAT(address, StartsWith("0.0.0.0:")) << guarded.err();
}

TEST_F(ServerSecurityTest, FilesThatAreWrongAreRefusedAtTheStart) {
  std::ofstream(File("empty"));
  std::ofstream(File("bad_tokens")) << "# clients\n\nrenderer tl_secret\n";
  MakeCertificate("open", "ca", "DNS:open");
  std::filesystem::copy_file(File("tokens"), File("open_tokens"));
  chmod(File("open_tokens").c_str(), 0666);
  const std::string certificate = File("server.pem"), key = File("server.key");
  struct Case {
    std::vector<std::string> arguments;
    std::string message;
    int code;
  };
  for (const Case& wrong : std::vector<Case>{
           {{"--tls-cert", certificate}, "TLS needs both --tls-cert and --tls-key", 2},
           {{"--tls-client-ca", certificate}, "TLS needs both --tls-cert and --tls-key", 2},
           {{"--tls-cert", certificate, "--tls-key", File("none")},
            "--tls-key '" + File("none") + "': No such file",
            1},
           {{"--tls-cert", File("empty"), "--tls-key", key},
            "--tls-cert '" + File("empty") + "': holds no certificate in PEM",
            1},
           {{"--tls-cert", certificate, "--tls-key", File("client.key")},
            "--tls-key '" + File("client.key") + "': is not the key of '" + certificate + "'",
            1},
           {{"--tls-cert", certificate, "--tls-key", key, "--tls-client-ca", File("empty")},
            "--tls-client-ca '" + File("empty") + "': holds no certificate in PEM",
            1},
           {{"--token-file", File("none")}, "token file '" + File("none") + "': No such file", 1},
           {{"--token-file", File("empty")}, "has no token; treelightd token NAME", 1},
           {{"--token-file", File("bad_tokens")},
            "line 3: the second word is not sha256: and 64 hexadecimal digits",
            1},
           {{"--token-file", File("open_tokens")}, "can be written by everybody: chmod o-w", 1}}) {
    std::vector<std::string> arguments = wrong.arguments;
    arguments.insert(arguments.end(), {"--listen", "127.0.0.1:0"});
    Process server(arguments);
    EXPECT_EQ(server.Wait(), wrong.code);
    EXPECT_THAT(server.err(), HasSubstr(wrong.message));
    EXPECT_THAT(server.err(), ::testing::Not(HasSubstr("tl_secret")));
    EXPECT_EQ(Lines(server.err()), 1u) << server.err();
  }
}

TEST_F(ServerSecurityTest, ATokenOpensEveryCallAndHealthNeedsNone) {
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

TEST_F(ServerSecurityTest, TokensAreTakenUpAndWithdrawnWhileItServes) {
  Process server(WithTokens({"--listen", "127.0.0.1:0"}));
  const std::string address = server.WaitUntilReady();
  AddToken("second");
  EXPECT_TRUE(Eventually([&] { return Ask(address, {.token_file = File("second")}).ok(); }));
  const auto old = PhotonMapClient::Connect(address, {.token_file = File("renderer")}, 20s);
  EXPECT_TRUE((*old)->GetServerInfo().ok());

  // Replaced by one without the first; also for a connection that is open.
  Run("grep second tokens > new && mv new tokens");
  server.Signal(SIGHUP);
  EXPECT_TRUE(
      Eventually([&] { return absl::IsUnauthenticated((*old)->GetServerInfo().status()); }));
  EXPECT_TRUE(Ask(address, {.token_file = File("second")}).ok());

  // A file that cannot be read is told once, and the tokens stay.
  Run("echo nonsense > new && mv new tokens");
  EXPECT_TRUE(
      Eventually([&] { return server.err().find("line 1: 1 words") != std::string::npos; }));
  EXPECT_TRUE(Ask(address, {.token_file = File("second")}).ok());
}

TEST_F(ServerSecurityTest, TlsServesThoseWhoTrustItsCaAndTellsTheOthers) {
  Process server(WithTls({"--listen", "127.0.0.1:0"}));
  const std::string address = server.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << server.err();
  EXPECT_TRUE(Ask(address, Tls()).ok()) << Ask(address, Tls());
  Process health(WithTls({"healthcheck", "--listen", address}));
  EXPECT_EQ(health.Wait(), 0) << health.err();
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
  })) << Ask(address, Tls());

  // TLS to a server without.
  Process plain({"--listen", "127.0.0.1:0"});
  EXPECT_THAT(std::string(Ask(plain.WaitUntilReady(), Tls()).message()),
              HasSubstr("the server speaks no TLS"));
}

TEST_F(ServerSecurityTest, AClientCaAsksForCertificates) {
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

TEST_F(ServerSecurityTest, CertificatesThatChangeAreTakenUp) {
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

TEST_F(ServerSecurityTest, AClientCaThatChangesIsTakenUp) {
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

TEST_F(ServerSecurityTest, ATokenLeavesTheMachineEncryptedOrByOrder) {
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

TEST_F(ServerSecurityTest, TokenAndTlsTogetherFromTheEnvironment) {
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

TEST_F(ServerSecurityTest, BytesThatAreNoRequestLeaveNoLineOfALibrary) {
  Process server({"--listen", "127.0.0.1:0", "--log-file", File("requests")});
  const std::string address = server.WaitUntilReady();
  for (const char* bytes : {"\x0a\x02\xff\xfe", "\xff\xff\xff\xff", "\x0a\x7f"}) {
    EXPECT_FALSE(CallRaw(address, "/treelight.v1.PhotonMapService/GetPhotonMap", bytes).ok());
  }
  EXPECT_TRUE(Ask(address, {}).ok());
  EXPECT_EQ(server.err(), "");
}

TEST_F(ServerSecurityTest, AUnixSocketHasThePermissionsThatWereAskedFor) {
  const std::string address = "unix:" + File("socket");
  for (const auto& [mode, expected] : {std::pair{"", 0600}, std::pair{"0660", 0660}}) {
    std::vector<std::string> arguments = {"--listen", address};
    if (*mode != '\0') arguments.insert(arguments.end(), {"--socket-mode", mode});
    Process server(arguments);
    ASSERT_EQ(server.WaitUntilReady(), address) << server.err();
    struct stat status {};
    ASSERT_EQ(stat(File("socket").c_str(), &status), 0);
    EXPECT_EQ(status.st_mode & 0777, static_cast<mode_t>(expected));
    EXPECT_TRUE(Ask(address, {}).ok());
    server.Signal(SIGTERM);
    EXPECT_EQ(server.Wait(), 0);
  }
  Process wrong({"--listen", address, "--socket-mode", "0999"});
  EXPECT_EQ(wrong.Wait(), 2);
}

}  // namespace
}  // namespace treelight::testing
