#ifndef TREELIGHT_SERVER_MERGED_MAP_OF_H_
#define TREELIGHT_SERVER_MERGED_MAP_OF_H_

#include <memory>

#include "absl/status/statusor.h"
#include "core/gatherer.h"
#include "core/merged_gather.h"
#include "server/map_store.h"
#include "server/state.h"

namespace treelight::server {

/// The map of fewer photons of `map`, made by the server's builder with the options of `map`
/// where it is not there, on the device's thread. RESOURCE_EXHAUSTED: there is no room for it, or
/// for the copies of tree and photons that it is made of. The errors of Gatherer::ReadTree,
/// ReadPhotons and Builder::Build.
absl::StatusOr<MapOfFewer> MergedMapOf(State& state, const StoredMap& map,
                                       const FewerPhotons& fewer, const CancelCheck& cancelled);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_MERGED_MAP_OF_H_
