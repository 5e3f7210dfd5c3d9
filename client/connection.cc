#include "client/connection.h"

#include <arpa/inet.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string_view>
#include <utility>
#include <vector>

#include "fmt/format.h"
#include "grpc/grpc.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/security/credentials.h"
#include "grpcpp/support/client_interceptor.h"

namespace treelight::client {
namespace {

// How long one attempt to connect may take, so that a host that swallows packets does not hang the
// caller.
constexpr int kConnectTimeoutMs = 5000;

using grpc::experimental::ClientInterceptorFactoryInterface;
using grpc::experimental::InterceptionHookPoints;

// Adds the token to every call. gRPC's own call credentials work on TLS alone, and a Unix socket
// needs none of that.
class TokenInterceptor final : public grpc::experimental::Interceptor {
 public:
  explicit TokenInterceptor(const std::string& token) : token_(token) {}

  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(InterceptionHookPoints::PRE_SEND_INITIAL_METADATA)) {
      methods->GetSendInitialMetadata()->emplace("authorization", fmt::format("Bearer {}", token_));
    }
    methods->Proceed();
  }

 private:
  const std::string& token_;
};

class TokenInterceptorFactory final : public ClientInterceptorFactoryInterface {
 public:
  explicit TokenInterceptorFactory(std::string token) : token_(std::move(token)) {}

  grpc::experimental::Interceptor* CreateClientInterceptor(
      grpc::experimental::ClientRpcInfo*) override {
    return new TokenInterceptor(token_);  // gRPC owns it, and has a raw pointer in its interface
  }

 private:
  const std::string token_;
};

// The whole of `file`, which `what` says the use of.
absl::StatusOr<std::string> ReadFile(std::string_view what, const std::string& file) {
  std::ifstream stream(file, std::ios::binary);
  std::string text{std::istreambuf_iterator<char>(stream), {}};
  if (stream && !text.empty()) return text;
  const int error = stream.is_open() && text.empty() ? 0 : errno;
  return absl::PermissionDeniedError(
      fmt::format("{} '{}': {}", what, file, error == 0 ? "is empty" : std::strerror(error)));
}

absl::StatusOr<std::string> ReadToken(const std::string& file) {
  auto text = ReadFile("token file", file);
  if (!text.ok()) return text;
  while (!text->empty() && (text->back() == '\n' || text->back() == '\r')) text->pop_back();
  const bool printable =
      std::all_of(text->begin(), text->end(), [](char c) { return c > ' ' && c < '\x7f'; });
  if (!text->empty() && printable) return text;
  return absl::InvalidArgumentError(fmt::format(
      "token file '{}': expected one token on one line, as treelightd token prints it", file));
}

// TLS: the files where they are given, else the system's CAs.
absl::StatusOr<std::shared_ptr<grpc::ChannelCredentials>> MakeCredentials(
    const ConnectionOptions& options) {
  if (options.transport == Transport::kPlaintext) return grpc::InsecureChannelCredentials();
  grpc::SslCredentialsOptions ssl;
  for (const auto& [option, file, text] :
       {std::tuple{"CA file", &options.tls_ca, &ssl.pem_root_certs},
        std::tuple{"certificate", &options.tls_certificate, &ssl.pem_cert_chain},
        std::tuple{"key", &options.tls_key, &ssl.pem_private_key}}) {
    if (file->empty()) continue;
    auto read = ReadFile(option, *file);
    if (!read.ok()) return read.status();
    if (read->find("-----BEGIN ") == std::string::npos) {
      return absl::InvalidArgumentError(fmt::format("{} '{}': is not PEM", option, *file));
    }
    *text = *std::move(read);
  }
  if (ssl.pem_cert_chain.empty() != ssl.pem_private_key.empty()) {
    return absl::InvalidArgumentError(
        "a client certificate needs its key, and a key its "
        "certificate (--tls-cert, --tls-key)");
  }
  return grpc::SslCredentials(ssl);
}

}  // namespace

bool IsLocal(const std::string& target) {
  if (target.starts_with("unix:") || target.starts_with("unix-abstract:")) return true;
  std::string host = target.substr(0, target.rfind(':'));
  if (host.size() >= 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  }
  in_addr address{};
  return host == "localhost" || host == "::1" ||
         (inet_pton(AF_INET, host.c_str(), &address) == 1 && (ntohl(address.s_addr) >> 24) == 127);
}

absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(const std::string& target,
                                                           const ConnectionOptions& options) {
  // gRPC stays initialised until the process ends: the last shutdown of 1.51 waits for a thread of
  // its own, which polls for ten seconds where a write had to wait for the socket.
  [[maybe_unused]] static const bool initialised = (grpc_init(), true);
  const auto credentials = MakeCredentials(options);
  if (!credentials.ok()) return credentials.status();
  std::vector<std::unique_ptr<ClientInterceptorFactoryInterface>> interceptors;
  if (!options.token_file.empty()) {
    auto token = ReadToken(options.token_file);
    if (!token.ok()) return token.status();
    if (options.transport == Transport::kPlaintext && !IsLocal(target) &&
        !options.send_token_in_plaintext) {
      return absl::InvalidArgumentError(
          fmt::format("the token would go to {} unencrypted; use TLS (--tls or --tls-ca), or say "
                      "--insecure",
                      target));
    }
    interceptors.push_back(std::make_unique<TokenInterceptorFactory>(*std::move(token)));
  }
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(
      -1);  // the server's limit counts, which may be set higher than the default
  arguments.SetInt(GRPC_ARG_MIN_RECONNECT_BACKOFF_MS, kConnectTimeoutMs);
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY,
                   0);  // a proxy for the web has no use for a server nearby
  return grpc::experimental::CreateCustomChannelWithInterceptors(target, *credentials, arguments,
                                                                 std::move(interceptors));
}

}  // namespace treelight::client
