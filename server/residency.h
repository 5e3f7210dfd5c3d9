#ifndef TREELIGHT_SERVER_RESIDENCY_H_
#define TREELIGHT_SERVER_RESIDENCY_H_

#include <algorithm>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string_view>

#include "absl/status/statusor.h"
#include "server/convert.h"
#include "server/reloadable_map.h"
#include "server/state.h"

// Which maps are on the device: those that can come back leave it for others, those first that were
// not used for the longest time.
namespace treelight::server {

/// Which maps may leave.
enum class Leaving {
  kAll,  ///< photons that are nowhere else are copied, which may take long and wait for the device
  kAtOnce,  ///< those alone whose photons are kept anyway: for threads that must not be held up
};

/// Lets maps that nobody uses leave the device until they have held `bytes` together; none where
/// all of them hold less than `least`. What they held, 0 where none has left.
std::uint64_t EvictIdleMaps(State& state, std::uint64_t bytes, std::uint64_t least = 0,
                            Leaving leaving = Leaving::kAll);

/// The status of either kind of result.
inline const absl::Status& StatusOf(const absl::Status& status) { return status; }
template <typename T>
const absl::Status& StatusOf(const absl::StatusOr<T>& result) {
  return result.status();
}

/// Where something is to be put, as far as is known of it.
struct Space {
  std::uint64_t all_bytes = std::numeric_limits<std::uint64_t>::max();
  std::function<std::uint64_t()> free_bytes{};  ///< at present; empty: nobody knows
  std::uint64_t needed_bytes = 0;  ///< with which one may do in it; 0: with no less than are wanted
};

/// The host's memory; of no size on a device with memory of its own, where maps that leave give
/// back none of the host's.
Space HostSpace(const State& state);

/// The memory of the server's device, for a map of `plan`; of no size where it could never hold it.
Space DeviceSpace(const State& state, const DeviceInfo& device, const BuildPlan& plan);

/// What `take` returns; as long as that is RESOURCE_EXHAUSTED and idle maps can leave, they do, for
/// what is missing of `bytes`, and it is called again. None leaves where all that are idle hold too
/// little.
template <typename Take>
auto WithEviction(State& state, std::uint64_t bytes, const Space& space, Take take,
                  Leaving leaving = Leaving::kAll) {
  while (true) {
    auto taken = take();
    if (taken.ok() || !absl::IsResourceExhausted(StatusOf(taken)) || bytes > space.all_bytes) {
      return taken;
    }
    const auto missing = [free = space.free_bytes ? space.free_bytes() : 0](std::uint64_t wanted) {
      return std::max<std::uint64_t>(1, wanted - std::min(wanted, free));
    };
    const std::uint64_t needed = space.needed_bytes > 0 ? space.needed_bytes : bytes;
    const std::uint64_t least = space.free_bytes ? missing(needed) : 0;
    if (EvictIdleMaps(state, missing(bytes), least, leaving) == 0) return taken;
  }
}

/// Host memory for what a call keeps, from a thread that must not be held up. The errors of
/// MemoryBudget::Take.
absl::StatusOr<MemoryBudget::Share> TakeForCall(State& state, Holder holder, std::uint64_t bytes,
                                                std::string_view what);

/// Gives `map` a gatherer whose tree may leave the device: its photons are then with `keeper`, from
/// which they come back. `tree` may be null.
void MakeReloadable(State& state, StoredMap& map, ReloadableMap::Description description,
                    std::shared_ptr<PhotonKeeper> keeper, std::shared_ptr<const ResidentTree> tree);

/// The same for a map whose tree is built, with its own gatherer and memory.
void MakeReloadable(State& state, StoredMap& map, std::shared_ptr<PhotonKeeper> keeper);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_RESIDENCY_H_
