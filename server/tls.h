#ifndef TREELIGHT_SERVER_TLS_H_
#define TREELIGHT_SERVER_TLS_H_

#include <memory>

#include "absl/status/status.h"
#include "grpcpp/security/credentials.h"
#include "grpcpp/security/server_credentials.h"
#include "server/options.h"

namespace treelight::server {

/// How often changed certificates are looked for.
inline constexpr unsigned kCertificateSeconds = 1;

/// Reads the files of `tls`. INVALID_ARGUMENT: one cannot be read or is not PEM, the key is not
/// that of the certificate, or the certificate has expired; the message names file and option. OK
/// where there is no TLS.
absl::Status CheckTlsFiles(const TlsFiles& tls);

/// Credentials that take up changed files within kCertificateSeconds for connections that come
/// after that; without encryption where `tls` is empty. With a client CA, a client must show a
/// certificate of it before anything else of it is read.
std::shared_ptr<grpc::ServerCredentials> MakeServerCredentials(const TlsFiles& tls);

/// For a client on the server's own machine that has its files: it trusts the server's certificate
/// and no other, by whatever name it asks, and shows that same certificate.
std::shared_ptr<grpc::ChannelCredentials> MakeOwnChannelCredentials(const TlsFiles& tls);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_TLS_H_
