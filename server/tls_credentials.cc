#include "server/tls_credentials.h"

#include <cstdlib>
#include <utility>

#include "fmt/format.h"
#include "grpc/grpc.h"
#include "server/break_switch.h"

namespace treelight::server {

absl::StatusOr<std::shared_ptr<TlsCredentials>> TlsCredentials::Open(const TlsFiles& files) {
  auto texts = ReadTlsFiles(files);
  if (!texts.ok()) return texts.status();
  return std::shared_ptr<TlsCredentials>(new TlsCredentials(files, *std::move(texts)));
}

TlsCredentials::TlsCredentials(const TlsFiles& files, TlsTexts texts)
    : files_(files),
      texts_(std::move(texts)),
      credentials_(grpc_ssl_server_credentials_create_with_options(
          grpc_ssl_server_credentials_create_options_using_config_fetcher(
              files.client_ca.empty() || Broken("client_ca")
                  ? GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE
                  : GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY,
              Fetch, this))) {}

TlsCredentials::~TlsCredentials() { grpc_server_credentials_release(credentials_); }

absl::Status TlsCredentials::Reload() {
  const std::lock_guard reload_lock(reload_);
  auto texts = ReadTlsFiles(files_);
  if (!texts.ok()) {
    return {texts.status().code(),
            fmt::format("{}; the certificates that were read before stay in use",
                        std::string(texts.status().message()))};
  }
  if (Broken("certificate_change")) return absl::OkStatus();
  const std::lock_guard lock(mutex_);
  texts_ = *std::move(texts);
  fresh_ = true;
  return absl::OkStatus();
}

void TlsCredentials::SetAuthMetadataProcessor(const std::shared_ptr<grpc::AuthMetadataProcessor>&) {
  std::abort();
}

int TlsCredentials::AddPortToServer(const std::string& address, grpc_server* server) {
  return grpc_server_add_http2_port(server, address.c_str(), credentials_);
}

grpc_ssl_certificate_config_reload_status TlsCredentials::Fetch(
    void* self, grpc_ssl_server_certificate_config** config) {
  auto& tls = *static_cast<TlsCredentials*>(self);
  const std::lock_guard lock(tls.mutex_);
  if (!tls.fresh_) return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_UNCHANGED;
  const grpc_ssl_pem_key_cert_pair pair{tls.texts_.key.c_str(), tls.texts_.certificate.c_str()};
  // It asserts that there is a CA, also where clients are not asked for a certificate: then any.
  const std::string& ca =
      tls.texts_.client_ca.empty() ? tls.texts_.certificate : tls.texts_.client_ca;
  *config = grpc_ssl_server_certificate_config_create(ca.c_str(), &pair, 1);
  tls.fresh_ = false;
  return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_NEW;
}

}  // namespace treelight::server
