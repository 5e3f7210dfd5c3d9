#ifndef TREELIGHT_TESTS_SECURITY_FIXTURE_H_
#define TREELIGHT_TESTS_SECURITY_FIXTURE_H_

#include <chrono>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "client/photon_map_client.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "gtest/gtest.h"
#include "tests/server_process.h"
#include "tests/temporary_folder.h"

namespace treelight::testing {

/// A folder with a CA, certificates of it, a second CA, and a token.
class SecurityTest : public ::testing::Test {
 protected:
  SecurityTest() {
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
  client::ConnectionOptions Tls() const {
    return {.transport = client::Transport::kTls, .tls_ca = File("ca.pem")};
  }

  /// How GetServerInfo ends.
  static absl::Status Ask(const std::string& address, const client::ConnectionOptions& options) {
    const auto client =
        client::PhotonMapClient::Connect(address, options, std::chrono::seconds(20));
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

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_SECURITY_FIXTURE_H_
