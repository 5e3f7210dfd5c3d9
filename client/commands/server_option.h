#ifndef TREELIGHT_CLIENT_COMMANDS_SERVER_OPTION_H_
#define TREELIGHT_CLIENT_COMMANDS_SERVER_OPTION_H_

#include <memory>

#include "CLI/CLI.hpp"
#include "absl/status/statusor.h"
#include "client/commands/command.h"
#include "client/photon_map_client.h"

namespace treelight::client {

/// Adds --server, --timeout, and the options of TLS and tokens to `app`; `global` must outlive it.
void AddServerOptions(CLI::App& app, GlobalOptions& global);

/// A client of the server that the options say. Does not connect yet. The errors of
/// PhotonMapClient::Connect.
absl::StatusOr<std::unique_ptr<PhotonMapClient>> Connect(const GlobalOptions& global);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_SERVER_OPTION_H_
