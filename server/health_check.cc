#include "server/health_check.h"

#include <string_view>
#include <vector>

#include "fmt/format.h"
#include "grpcpp/client_context.h"
#include "grpcpp/completion_queue.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "server/break_switch.h"
#include "server/tls.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::server {
namespace {

/// Of an address that stands for all interfaces: loopback.
std::string Reachable(const std::string& listen) {
  const std::size_t colon = listen.rfind(':');
  const std::string host = listen.substr(0, colon);
  if (host == "0.0.0.0") return "127.0.0.1" + listen.substr(colon);
  if (host == "[::]") return "[::1]" + listen.substr(colon);
  return listen;
}

/// A HealthCheckRequest: its first field is the name of the service. The messages of
/// grpc/health/v1 are not packaged, and two bytes long.
grpc::ByteBuffer MakeRequest() {
  const std::string_view service = v1::PhotonMapService::service_full_name();
  const std::string wire =
      fmt::format("{}{}{}", '\x0a', static_cast<char>(service.size()), service);
  const grpc::Slice slice(wire);
  return {&slice, 1};
}

/// Whether a HealthCheckResponse says SERVING: its field 1 is 1.
bool IsServing(grpc::ByteBuffer& response) {
  std::vector<grpc::Slice> slices;
  if (!response.Dump(&slices).ok()) return false;
  std::string wire;
  for (const grpc::Slice& slice : slices) wire.append(slice.begin(), slice.end());
  return wire == "\x08\x01" || Broken("healthcheck");
}

}  // namespace

absl::Status CheckHealth(const HealthCheck& check, std::chrono::milliseconds timeout) {
  const auto tls = ReadTlsFiles(check.tls);
  if (!tls.ok()) return tls.status();
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  grpc::GenericStub stub(grpc::CreateCustomChannel(Reachable(check.listen),
                                                   MakeOwnChannelCredentials(*tls), arguments));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + timeout);
  grpc::CompletionQueue queue;
  grpc::ByteBuffer response;
  grpc::Status status;
  const auto call =
      stub.PrepareUnaryCall(&context, "/grpc.health.v1.Health/Check", MakeRequest(), &queue);
  call->StartCall();
  call->Finish(&response, &status, nullptr);
  void* tag = nullptr;
  bool ok = false;
  queue.Next(&tag, &ok);
  if (!status.ok()) {
    // What a server with TLS does to who speaks without.
    const std::string why = status.error_message();
    const bool hung_up = check.tls.empty() && (why.find("Socket closed") != why.npos ||
                                               why.find("reset by peer") != why.npos);
    return absl::UnavailableError(fmt::format(
        "'{}' does not answer: {}{}", check.listen, why,
        hung_up ? "; where it serves with TLS, give its --tls-cert and --tls-key" : ""));
  }
  if (!IsServing(response))
    return absl::UnavailableError(fmt::format("'{}' says that it does not serve", check.listen));
  return absl::OkStatus();
}

}  // namespace treelight::server
