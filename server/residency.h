#ifndef TREELIGHT_SERVER_RESIDENCY_H_
#define TREELIGHT_SERVER_RESIDENCY_H_

#include <cstdint>
#include <limits>
#include <memory>

#include "absl/status/statusor.h"
#include "server/reloadable_map.h"
#include "server/state.h"

// Which maps are on the device: those that can come back leave it for others, those first that were
// not used for the longest time.
namespace treelight::server {

/// Lets maps that nobody uses leave the device until they have held `bytes` together; what they
/// held, 0 where none can leave.
std::uint64_t EvictIdleMaps(State& state, std::uint64_t bytes);

/// The status of either kind of result.
inline const absl::Status& StatusOf(const absl::Status& status) { return status; }
template <typename T>
const absl::Status& StatusOf(const absl::StatusOr<T>& result) {
  return result.status();
}

/// Room for whatever is asked for.
inline constexpr std::uint64_t kAnyBytes = std::numeric_limits<std::uint64_t>::max();

/// What `take` returns; as long as that is RESOURCE_EXHAUSTED and idle maps can leave, they do, for
/// `bytes`, and it is called again. None leaves for what would not fit into all the `room` there
/// is.
template <typename Take>
auto WithEviction(State& state, std::uint64_t bytes, std::uint64_t room, Take take) {
  while (true) {
    auto taken = take();
    if (taken.ok() || !absl::IsResourceExhausted(StatusOf(taken)) || bytes > room ||
        EvictIdleMaps(state, bytes) == 0) {
      return taken;
    }
  }
}

/// The `room` of host memory: on a device with memory of its own, maps that leave give back none.
inline std::uint64_t HostRoom(const State& state) {
  return state.maps_in_host_memory() ? state.memory.room_bytes() : 0;
}

/// Gives `map` a gatherer whose tree may leave the device: its photons are then with `keeper`, from
/// which they come back. `tree` may be null.
void MakeReloadable(State& state, StoredMap& map, ReloadableMap::Description description,
                    std::shared_ptr<PhotonKeeper> keeper, std::shared_ptr<const ResidentTree> tree);

/// The same for a map whose tree is built, with its own gatherer and memory.
void MakeReloadable(State& state, StoredMap& map, std::shared_ptr<PhotonKeeper> keeper);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_RESIDENCY_H_
