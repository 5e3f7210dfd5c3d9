#ifndef TREELIGHT_CLIENT_MAP_METADATA_H_
#define TREELIGHT_CLIENT_MAP_METADATA_H_

#include <algorithm>
#include <cstddef>
#include <string>

#include "grpcpp/client_context.h"

namespace treelight::client {

/// Tells of which map a call is, by the metadata x-treelight-map, so that a balancer sends all
/// calls of one map to one server. What cannot be the name of a map stays out: a server refuses it,
/// and gRPC takes no other than printable characters.
inline void NameMap(grpc::ClientContext& context, const std::string& map) {
  constexpr std::size_t kMaxNameLength = 128;
  const bool plain =
      std::all_of(map.begin(), map.end(), [](char c) { return c > ' ' && c < '\x7f'; });
  if (plain && !map.empty() && map.size() <= kMaxNameLength) {
    context.AddMetadata("x-treelight-map", map);
  }
}

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_MAP_METADATA_H_
