#ifndef TREELIGHT_SERVER_PERSISTENCE_H_
#define TREELIGHT_SERVER_PERSISTENCE_H_

#include <vector>

#include "absl/status/statusor.h"
#include "core/model/photons.h"
#include "server/map_store.h"
#include "server/state.h"

// Maps that survive the server: what --data-dir does with builds, deletes, expiry and the start.
namespace treelight::server {

/// Puts the map of a file into the store, off the device until it is asked for: that map. Damaged
/// files are set aside and told on stderr, those of expired maps removed: null. What cannot be
/// loaded, since a later program has written it, stays and is told: its error.
absl::StatusOr<MapHandle> TakeUp(State& state, const SnapshotFolder::File& file);

/// Puts the maps of the folder into the store, off the device until they are asked for. What is
/// damaged is set aside and told on stderr, what has expired is removed, and what a later program
/// has written stays and is told. Reads every byte. From now on the store follows the folder
/// (FolderMirror), and versions that expire leave the folder too. PERMISSION_DENIED, INTERNAL: the
/// folder cannot be read or written to.
absl::Status LoadSnapshots(State& state);

/// Writes `map`, just built from `photons`, to the folder and then adds it to the store, on the
/// thread of the disk; where another server has built for its request id before, that map. The
/// errors of SnapshotFolder::Write and, of that map, CheckRepeat: then there is no such map.
absl::StatusOr<MapHandle> KeepMap(State& state, StoredMap map, const Photons& photons);

/// Takes versions out of store and folder, as MapStore::Remove; on the thread of the disk where
/// there is a folder. INTERNAL: the disk fails, and the versions are here still.
absl::StatusOr<std::vector<MapHandle>> RemoveMaps(State& state, std::string_view name,
                                                  std::uint64_t version);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_PERSISTENCE_H_
