#include "server/server.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "grpcpp/ext/proto_server_reflection_plugin.h"
#include "grpcpp/impl/server_builder_option.h"
#include "grpcpp/impl/server_builder_plugin.h"
#include "grpcpp/resource_quota.h"
#include "grpcpp/security/server_credentials.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "server/acceptor.h"
#include "server/address.h"
#include "server/break_switch.h"
#include "server/file_watch.h"
#include "server/health.h"
#include "server/listening_sockets.h"
#include "server/metrics_endpoint.h"
#include "server/persistence.h"
#include "server/service.h"
#include "server/tell.h"
#include "server/tls_credentials.h"
#include "server/tokens.h"
#include "server/unix_socket.h"
#include "server/unknown_methods.h"

namespace treelight::server {
namespace {

/// Clients may ping this often, calls open or not; gRPC's default of five minutes cuts keepalive
/// clients off.
constexpr int kMinPingIntervalMs = 5'000;
/// A client that has vanished is noticed after these two.
constexpr int kPingIntervalMs = 60'000, kPingTimeoutMs = 20'000;
/// Metadata of a call, bytes.
constexpr int kMaxMetadataBytes = 8192;
/// Who connects and does not speak HTTP/2, or TLS first, is cut off.
constexpr int kHandshakeTimeoutMs = 10'000;
/// Threads of gRPC's own for calls of reflection, each of which keeps one until it ends, and may
/// have a message on its way; more such calls are refused. Our calls have none.
constexpr int kMaxReflectionThreads = 8;
/// How often changed files are looked for.
constexpr std::chrono::seconds kWatchInterval{1};

void Configure(const ServerOptions& options, grpc::ServerBuilder& builder) {
  builder.SetMaxReceiveMessageSize(static_cast<int>(options.limits.max_message_bytes));
  builder.SetMaxSendMessageSize(static_cast<int>(options.limits.max_message_bytes));
  // gRPC unpacks a message as far as it goes, gigabytes of 4 MiB, before it looks at the limit.
  for (const auto algorithm : {GRPC_COMPRESS_DEFLATE, GRPC_COMPRESS_GZIP}) {
    builder.SetCompressionAlgorithmSupportStatus(algorithm, Broken("compression"));
  }
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS,
                             kMinPingIntervalMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_PERMIT_WITHOUT_CALLS, 1);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, kPingIntervalMs);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, kPingTimeoutMs);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, static_cast<int>(kMaxStreams));
  builder.AddChannelArgument(GRPC_ARG_MAX_METADATA_SIZE, kMaxMetadataBytes);
  builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, kHandshakeTimeoutMs);
  // Else the window of a stream, which a client may fill and no call reads, grows with the speed of
  // its connection.
  builder.AddChannelArgument(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  grpc::ResourceQuota quota;
  quota.SetMaxThreads(kMaxReflectionThreads);
  builder.SetResourceQuota(quota);
}

/// Takes reflection out, which joins every server by being linked: it asks nobody for a token.
class WithoutReflection final : public grpc::ServerBuilderOption {
 public:
  void UpdateArguments(grpc::ChannelArguments*) override {}
  void UpdatePlugins(std::vector<std::unique_ptr<grpc::ServerBuilderPlugin>>* plugins) override {
    std::erase_if(*plugins,
                  [](const auto& plugin) { return plugin->name() == "proto_server_reflection"; });
  }
};

void Tell(const absl::Status& status) {
  if (!status.ok()) server::Tell(std::string(status.message()));
}

/// Hands `connection` to gRPC, which closes it.
void HandOver(grpc::experimental::ExternalConnectionAcceptor& server, FileHandle connection) {
  grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters parameters;
  parameters.fd = connection.Release();
  server.HandleNewConnection(&parameters);
}

}  // namespace

struct Server::Impl {
  Impl(const ServerOptions& options, std::unique_ptr<Builder> builder,
       std::unique_ptr<RequestLog> log, std::unique_ptr<Tokens> tokens)
      : state(options, std::move(builder), std::move(log), std::move(tokens)),
        service(state),
        health(state.stalls, state.floods),
        unknown(state.floods) {}

  SocketLock lock;  // first: held until the server has let go of the socket
  State state;
  PhotonMapService service;
  Health health;
  UnknownMethods unknown;
  int port = 0;
  std::shared_ptr<TlsCredentials> tls;       // null where nothing is encrypted; outlives `server`
  std::unique_ptr<MetricsEndpoint> metrics;  // null where nobody asked for it
  std::unique_ptr<grpc::Server> server;      // its calls use the rest
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> clients;  // of `server`
  std::optional<Acceptor> acceptor;                                         // uses `clients`
  std::optional<FileWatch> token_watch, tls_watch;
};

absl::StatusOr<std::unique_ptr<Server>> Server::Start(const ServerOptions& options,
                                                      std::unique_ptr<Builder> builder) {
  if (auto status = CheckOptions(options); !status.ok()) return status;
  std::shared_ptr<TlsCredentials> tls;
  if (!options.tls.empty()) {
    auto opened = TlsCredentials::Open(options.tls);
    if (!opened.ok()) return opened.status();
    tls = *std::move(opened);
  }
  std::unique_ptr<Tokens> tokens;
  if (!options.token_file.empty()) {
    auto opened = Tokens::Open(options.token_file);
    if (!opened.ok()) return opened.status();
    tokens = *std::move(opened);
  }
  auto lock = SocketLock::Take(options.listen);
  if (!lock.ok()) return lock.status();
  auto log = RequestLog::Open(options.log_file);
  if (!log.ok()) return log.status();
  auto impl =
      std::make_unique<Impl>(options, std::move(builder), *std::move(log), std::move(tokens));
  impl->lock = *std::move(lock);
  impl->tls = std::move(tls);

  if (!options.data_folder.empty()) {
    auto folder = SnapshotFolder::Open(options.data_folder);
    if (!folder.ok()) return folder.status();
    impl->state.snapshots = *std::move(folder);
    if (auto status = LoadSnapshots(impl->state); !status.ok()) return status;
  }
  if (!options.metrics_listen.empty()) {
    auto metrics = MetricsEndpoint::Start(options.metrics_listen, impl->state);
    if (!metrics.ok()) return metrics.status();
    impl->metrics = *std::move(metrics);
  }

  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder server_builder;
  Configure(options, server_builder);
  if (!options.token_file.empty()) server_builder.SetOption(std::make_unique<WithoutReflection>());
  server_builder.RegisterService(&impl->service);
  server_builder.RegisterService(&impl->health);
  server_builder.RegisterCallbackGenericService(&impl->unknown);
  ListeningSockets sockets;
  if (!options.listen.empty()) {
    auto bound = ListeningSockets::Bind(options.listen, options.socket_mode);
    if (!bound.ok()) return bound.status();
    sockets = *std::move(bound);
    impl->port = sockets.port();
    using Experimental = grpc::ServerBuilder::experimental_type;
    impl->clients = server_builder.experimental().AddExternalConnectionAcceptor(
        Experimental::ExternalConnectionType::FROM_FD,
        impl->tls == nullptr ? grpc::InsecureServerCredentials() : impl->tls);
  }
  impl->server = server_builder.BuildAndStart();
  if (impl->server == nullptr) return absl::InternalError("gRPC does not start");
  if (impl->state.tokens != nullptr) {
    impl->token_watch.emplace(std::vector{options.token_file}, kWatchInterval,
                              [&state = impl->state] { Tell(state.tokens->Reload()); });
  }
  if (impl->tls != nullptr) {
    std::vector<std::string> files = {options.tls.certificate, options.tls.key};
    if (!options.tls.client_ca.empty()) files.push_back(options.tls.client_ca);
    impl->tls_watch.emplace(std::move(files), kWatchInterval,
                            [&tls = *impl->tls] { Tell(tls.Reload()); });
    Tell(impl->tls->Reload());  // what has changed since they were read
  }
  if (impl->clients != nullptr) {
    impl->acceptor.emplace(
        std::move(sockets), impl->state.connections,
        [&clients = *impl->clients, &floods = impl->state.floods](FileHandle connection) {
          floods.Watch(connection.get());
          HandOver(clients, std::move(connection));
        });
  }
  return std::unique_ptr<Server>(new Server(std::move(impl)));
}

Server::Server(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}

Server::~Server() {
  impl_->acceptor.reset();
  impl_->server->Shutdown(std::chrono::system_clock::now());
}

int Server::port() const { return impl_->port; }

int Server::metrics_port() const { return impl_->metrics == nullptr ? 0 : impl_->metrics->port(); }

absl::Status Server::Reload() {
  absl::Status status = impl_->state.log->Reopen();
  if (impl_->state.tokens != nullptr) status.Update(impl_->state.tokens->Reload());
  if (impl_->tls != nullptr) status.Update(impl_->tls->Reload());
  return status;
}

std::string Server::address() const { return WithPort(impl_->state.options.listen, impl_->port); }

std::shared_ptr<grpc::Channel> Server::InProcessChannel(const grpc::ChannelArguments& arguments) {
  return impl_->server->InProcessChannel(arguments);
}

void Server::AnnounceEnd() {
  if (Broken("drain_delay")) impl_->state.calls.Close();
  if (!Broken("health")) impl_->health.Close();
}

std::size_t Server::Drain(std::chrono::system_clock::time_point deadline) {
  AnnounceEnd();
  impl_->state.calls.Close();
  const std::size_t cut_off = impl_->state.calls.WaitForNone(deadline);
  impl_->acceptor.reset();
  // Only health watchers, and what has run out of time, are open still: gRPC cancels them.
  impl_->server->Shutdown(std::chrono::system_clock::now());
  impl_->state.calls.WaitForNone(std::chrono::system_clock::time_point::max());
  return cut_off;
}

}  // namespace treelight::server
