#ifndef TREELIGHT_SERVER_TLS_H_
#define TREELIGHT_SERVER_TLS_H_

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "grpcpp/security/credentials.h"
#include "server/options.h"

namespace treelight::server {

/// What TlsFiles hold, PEM each; `client_ca` is empty where clients need no certificate.
struct TlsTexts {
  std::string certificate, key, client_ca;
};

/// Reads the files of `tls`. INVALID_ARGUMENT: one is not PEM, the key is not that of the
/// certificate, the certificate has expired, or OpenSSL does not serve with it (a key that is too
/// short). Errors as ReadSmallFile's. The message names file and option. Empty texts where there is
/// no TLS.
absl::StatusOr<TlsTexts> ReadTlsFiles(const TlsFiles& tls);

/// For a client on the server's own machine that has its files: it trusts the server's certificate
/// and no other, by whatever name it asks, and shows that same certificate. Without encryption
/// where `tls` is empty.
std::shared_ptr<grpc::ChannelCredentials> MakeOwnChannelCredentials(const TlsTexts& tls);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_TLS_H_
