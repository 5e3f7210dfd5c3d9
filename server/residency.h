#ifndef TREELIGHT_SERVER_RESIDENCY_H_
#define TREELIGHT_SERVER_RESIDENCY_H_

#include <memory>

#include "server/reloadable_map.h"
#include "server/state.h"

// Maps whose trees may leave the device, for others (room.h), and come back.
namespace treelight::server {

/// Gives `map` a gatherer whose tree may leave the device: its photons are then with `keeper`, from
/// which they come back. `tree` may be null.
void MakeReloadable(State& state, StoredMap& map, ReloadableMap::Description description,
                    std::shared_ptr<PhotonKeeper> keeper, std::shared_ptr<const ResidentTree> tree);

/// The same for a map whose tree is built, with its own gatherer and memory.
void MakeReloadable(State& state, StoredMap& map, std::shared_ptr<PhotonKeeper> keeper);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_RESIDENCY_H_
