#include "server/tls.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>
#include <string_view>

#include "fmt/format.h"
#include "grpcpp/security/tls_certificate_provider.h"
#include "grpcpp/security/tls_certificate_verifier.h"
#include "grpcpp/security/tls_credentials_options.h"
#include "server/break_switch.h"

namespace treelight::server {
namespace {

using grpc::experimental::FileWatcherCertificateProvider;

template <auto kFree>
struct Deleter {
  template <typename T>
  void operator()(T* object) const {
    kFree(object);
  }
};
using Certificate = std::unique_ptr<X509, Deleter<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Deleter<EVP_PKEY_free>>;

absl::Status Wrong(std::string_view option, std::string_view file, std::string_view why) {
  return absl::InvalidArgumentError(fmt::format("{} '{}': {}", option, file, why));
}

/// Opens `file` and gives it to `read`, which returns what it holds or null; `what` it should hold.
template <typename Read>
auto ReadPem(std::string_view option, const std::string& file, std::string_view what, Read read)
    -> absl::StatusOr<decltype(read(nullptr))> {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> opened(std::fopen(file.c_str(), "re"),
                                                               std::fclose);
  if (opened == nullptr) return Wrong(option, file, std::strerror(errno));
  auto object = read(opened.get());
  ERR_clear_error();
  if (object == nullptr) return Wrong(option, file, fmt::format("holds no {} in PEM", what));
  return object;
}

absl::StatusOr<Certificate> ReadCertificate(std::string_view option, const std::string& file) {
  auto certificate = ReadPem(option, file, "certificate", [](std::FILE* opened) {
    return Certificate(PEM_read_X509(opened, nullptr, nullptr, nullptr));
  });
  if (certificate.ok() && X509_cmp_current_time(X509_get0_notAfter(certificate->get())) < 0) {
    return Wrong(option, file, "the certificate has expired");
  }
  return certificate;
}

/// A key behind a password would make the server wait for somebody to type it.
int NoPassword(char*, int, int, void*) { return -1; }

}  // namespace

absl::Status CheckTlsFiles(const TlsFiles& tls) {
  if (tls.empty()) return absl::OkStatus();
  const auto certificate = ReadCertificate("--tls-cert", tls.certificate);
  if (!certificate.ok()) return certificate.status();
  const auto key =
      ReadPem("--tls-key", tls.key, "private key without a password", [](std::FILE* opened) {
        return Key(PEM_read_PrivateKey(opened, nullptr, NoPassword, nullptr));
      });
  if (!key.ok()) return key.status();
  const bool match = X509_check_private_key(certificate->get(), key->get()) == 1;
  ERR_clear_error();
  if (!match) {
    return Wrong("--tls-key", tls.key, fmt::format("is not the key of '{}'", tls.certificate));
  }
  if (tls.client_ca.empty()) return absl::OkStatus();
  return ReadCertificate("--tls-client-ca", tls.client_ca).status();
}

std::shared_ptr<grpc::ServerCredentials> MakeServerCredentials(const TlsFiles& tls) {
  if (tls.empty()) return grpc::InsecureServerCredentials();
  grpc::experimental::TlsServerCredentialsOptions options(
      std::make_shared<FileWatcherCertificateProvider>(
          tls.key, tls.certificate, tls.client_ca,
          Broken("certificate_change") ? 1'000'000 : kCertificateSeconds));
  options.watch_identity_key_cert_pairs();
  if (!tls.client_ca.empty() && !Broken("client_ca")) {
    options.watch_root_certs();
    options.set_cert_request_type(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  }
  return grpc::experimental::TlsServerCredentials(options);
}

std::shared_ptr<grpc::ChannelCredentials> MakeOwnChannelCredentials(const TlsFiles& tls) {
  if (tls.empty()) return grpc::InsecureChannelCredentials();
  grpc::experimental::TlsChannelCredentialsOptions options;
  options.set_certificate_provider(std::make_shared<FileWatcherCertificateProvider>(
      tls.key, tls.certificate, tls.certificate, kCertificateSeconds));
  options.watch_identity_key_cert_pairs();
  options.watch_root_certs();
  options.set_certificate_verifier(std::make_shared<grpc::experimental::NoOpCertificateVerifier>());
  options.set_check_call_host(false);
  return grpc::experimental::TlsCredentials(options);
}

}  // namespace treelight::server
