#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "tests/security_fixture.h"

// What a start refuses since others might reach it, and what strangers find.
namespace treelight::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;

using ServerSecurityTest = SecurityTest;

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
