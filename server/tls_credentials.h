#ifndef TREELIGHT_SERVER_TLS_CREDENTIALS_H_
#define TREELIGHT_SERVER_TLS_CREDENTIALS_H_

#include <memory>
#include <mutex>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "grpc/grpc_security.h"
#include "grpcpp/security/server_credentials.h"
#include "server/options.h"
#include "server/tls.h"

namespace treelight::server {

/// TLS of a server whose files may change while it runs: each new connection gets what was read
/// last and found right. gRPC never sees the files: its own watch of them ends the process where it
/// finds one empty (1.51).
class TlsCredentials final : public grpc::ServerCredentials {
 public:
  /// Reads `files`, which are not empty; errors as ReadTlsFiles'. With a client CA, a client must
  /// show a certificate of it before anything else of it is read.
  static absl::StatusOr<std::shared_ptr<TlsCredentials>> Open(const TlsFiles& files);

  /// No server uses it any more.
  ~TlsCredentials() override;

  /// Reads the files again, for connections that come after that. Errors as ReadTlsFiles', then
  /// all stays as it was, which the message tells. Thread-safe.
  absl::Status Reload();

  /// None: calls check their tokens themselves. Ends the process.
  void SetAuthMetadataProcessor(
      const std::shared_ptr<grpc::AuthMetadataProcessor>& processor) override;

 private:
  TlsCredentials(const TlsFiles& files, TlsTexts texts);

  int AddPortToServer(const std::string& address, grpc_server* server) override;

  /// gRPC asks it for each connection whether `*config` is to be another one.
  static grpc_ssl_certificate_config_reload_status Fetch(
      void* self, grpc_ssl_server_certificate_config** config);

  const TlsFiles files_;
  std::mutex reload_;  // held while the files are read, so that what was read last is set last
  std::mutex mutex_;
  TlsTexts texts_;     // guarded by mutex_
  bool fresh_ = true;  // guarded by mutex_: gRPC has not asked for texts_ yet
  grpc_server_credentials* const credentials_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_TLS_CREDENTIALS_H_
