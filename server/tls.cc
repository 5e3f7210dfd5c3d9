#include "server/tls.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>

#include <string_view>
#include <utility>
#include <vector>

#include "fmt/format.h"
#include "grpcpp/security/tls_certificate_provider.h"
#include "grpcpp/security/tls_certificate_verifier.h"
#include "grpcpp/security/tls_credentials_options.h"
#include "server/small_file.h"

namespace treelight::server {
namespace {

constexpr std::string_view kCertOption = "--tls-cert", kKeyOption = "--tls-key",
                           kClientCaOption = "--tls-client-ca";

template <auto kFree>
struct Deleter {
  template <typename T>
  void operator()(T* object) const {
    kFree(object);
  }
};
using Memory = std::unique_ptr<BIO, Deleter<BIO_free>>;
using Certificate = std::unique_ptr<X509, Deleter<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Deleter<EVP_PKEY_free>>;
using Context = std::unique_ptr<SSL_CTX, Deleter<SSL_CTX_free>>;

absl::Status Wrong(std::string_view option, std::string_view file, std::string_view why) {
  return absl::InvalidArgumentError(fmt::format("{} '{}': {}", option, file, why));
}

/// Reads `file` into `text` and gives it to `parse`, which returns what it holds or null; `what` it
/// should hold.
template <typename Parse>
auto ReadPem(std::string_view option, const std::string& file, std::string_view what,
             std::string& text, Parse parse) -> absl::StatusOr<decltype(parse(nullptr))> {
  auto read = ReadSmallFile(option, file);
  if (!read.ok()) return read.status();
  text = std::move(read->text);
  const Memory memory(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
  auto object = parse(memory.get());
  ERR_clear_error();
  if (object == nullptr) return Wrong(option, file, fmt::format("holds no {} in PEM", what));
  return object;
}

absl::StatusOr<Certificate> ReadCertificate(std::string_view option, const std::string& file,
                                            std::string& text) {
  auto certificate = ReadPem(option, file, "certificate", text, [](BIO* memory) {
    return Certificate(PEM_read_bio_X509(memory, nullptr, nullptr, nullptr));
  });
  if (certificate.ok() && X509_cmp_current_time(X509_get0_notAfter(certificate->get())) < 0) {
    return Wrong(option, file, "the certificate has expired");
  }
  return certificate;
}

/// A key behind a password would make the server wait for somebody to type it.
int NoPassword(char*, int, int, void*) { return -1; }

/// Whether OpenSSL serves with `certificate` and `key`, as gRPC will ask it to.
absl::Status CheckPair(const TlsFiles& tls, X509* certificate, EVP_PKEY* key) {
  const bool match = X509_check_private_key(certificate, key) == 1;
  ERR_clear_error();
  if (!match)
    return Wrong(kKeyOption, tls.key, fmt::format("is not the key of '{}'", tls.certificate));
  const Context context(SSL_CTX_new(TLS_server_method()));
  const bool serves = context != nullptr &&
                      SSL_CTX_use_certificate(context.get(), certificate) == 1 &&
                      SSL_CTX_use_PrivateKey(context.get(), key) == 1;
  const char* const why = ERR_reason_error_string(ERR_peek_last_error());
  ERR_clear_error();
  if (serves) return absl::OkStatus();
  return Wrong(kCertOption, tls.certificate, why == nullptr ? "OpenSSL does not take it" : why);
}

}  // namespace

absl::StatusOr<TlsTexts> ReadTlsFiles(const TlsFiles& tls) {
  TlsTexts texts;
  if (tls.empty()) return texts;
  const auto certificate = ReadCertificate(kCertOption, tls.certificate, texts.certificate);
  if (!certificate.ok()) return certificate.status();
  const auto key =
      ReadPem(kKeyOption, tls.key, "private key without a password", texts.key, [](BIO* memory) {
        return Key(PEM_read_bio_PrivateKey(memory, nullptr, NoPassword, nullptr));
      });
  if (!key.ok()) return key.status();
  if (auto status = CheckPair(tls, certificate->get(), key->get()); !status.ok()) return status;
  if (tls.client_ca.empty()) return texts;
  const auto ca = ReadCertificate(kClientCaOption, tls.client_ca, texts.client_ca);
  if (!ca.ok()) return ca.status();
  return texts;
}

std::shared_ptr<grpc::ChannelCredentials> MakeOwnChannelCredentials(const TlsTexts& tls) {
  if (tls.certificate.empty()) return grpc::InsecureChannelCredentials();
  using grpc::experimental::IdentityKeyCertPair;
  grpc::experimental::TlsChannelCredentialsOptions options;
  options.set_certificate_provider(
      std::make_shared<grpc::experimental::StaticDataCertificateProvider>(
          tls.certificate, std::vector{IdentityKeyCertPair{tls.key, tls.certificate}}));
  options.watch_identity_key_cert_pairs();
  options.watch_root_certs();
  options.set_certificate_verifier(std::make_shared<grpc::experimental::NoOpCertificateVerifier>());
  options.set_check_call_host(false);
  return grpc::experimental::TlsCredentials(options);
}

}  // namespace treelight::server
