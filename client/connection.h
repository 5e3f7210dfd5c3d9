#ifndef TREELIGHT_CLIENT_CONNECTION_H_
#define TREELIGHT_CLIENT_CONNECTION_H_

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "client/photon_map_client.h"
#include "grpcpp/channel.h"

namespace treelight::client {

/// Whether what goes to `target` stays on this machine: a Unix socket, localhost, 127.0.0.0/8,
/// [::1].
bool IsLocal(const std::string& target);

/// A channel to `target` as `options` say; does not connect yet. INVALID_ARGUMENT,
/// PERMISSION_DENIED: see PhotonMapClient::Connect.
absl::StatusOr<std::shared_ptr<grpc::Channel>> MakeChannel(const std::string& target,
                                                           const ConnectionOptions& options);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_CONNECTION_H_
