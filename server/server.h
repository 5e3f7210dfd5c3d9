#ifndef TREELIGHT_SERVER_SERVER_H_
#define TREELIGHT_SERVER_SERVER_H_

#include <chrono>
#include <cstddef>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "core/builder.h"
#include "grpcpp/channel.h"
#include "grpcpp/support/channel_arguments.h"
#include "server/options.h"

namespace treelight::server {

/// A running Treelight service with health (v1), and reflection where no tokens are asked for.
/// Files of TLS and tokens that change are taken up; where they are wrong, a line on stderr tells.
/// Safe to call from several threads at once.
class Server {
 public:
  /// Starts to serve maps that `builder` makes. INVALID_ARGUMENT: an option is wrong, CheckOptions,
  /// or a file of TLS or tokens. UNAVAILABLE: the address cannot be bound, nor that of the metrics.
  /// PERMISSION_DENIED: the log file, or the data folder, cannot be opened or written to.
  /// NOT_FOUND: there is no such token file.
  static absl::StatusOr<std::unique_ptr<Server>> Start(const ServerOptions& options,
                                                       std::unique_ptr<Builder> builder);

  /// Cancels what is still open, and waits for it to end.
  ~Server();

  /// TCP port bound; 0 where there is none (Unix socket, in-process only).
  int port() const;

  /// TCP port of the metrics; 0 where there is none.
  int metrics_port() const;

  /// Opens the file of the request log anew, after it was renamed, and reads the files of tokens
  /// and TLS again. The first error; what cannot be read anew stays as it was.
  absl::Status Reload();

  /// Where clients reach it: ServerOptions::listen with the port that was taken.
  std::string address() const;

  /// A channel that needs no socket. The server must outlive its calls.
  std::shared_ptr<grpc::Channel> InProcessChannel(const grpc::ChannelArguments& arguments = {});

  /// Health says NOT_SERVING from now on, so that balancers send new calls elsewhere; those that
  /// come are served still.
  void AnnounceEnd();

  /// Ends the service: health says NOT_SERVING and new calls get UNAVAILABLE at once, those that
  /// are open may finish until `deadline`, after which they are cancelled. Returns how many were;
  /// blocks until all have ended. Once only.
  std::size_t Drain(std::chrono::system_clock::time_point deadline);

 private:
  struct Impl;
  explicit Server(std::unique_ptr<Impl> impl);

  std::unique_ptr<Impl> impl_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_SERVER_H_
