#ifndef TREELIGHT_SERVER_RESIDENCY_H_
#define TREELIGHT_SERVER_RESIDENCY_H_

#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "server/convert.h"
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

/// What `take` returns; as long as that is RESOURCE_EXHAUSTED and idle maps can leave, they do, for
/// `bytes`, and it is called again.
template <typename Take>
auto WithEviction(State& state, std::uint64_t bytes, Take take) {
  while (true) {
    auto taken = take();
    if (taken.ok() || !absl::IsResourceExhausted(StatusOf(taken)) ||
        EvictIdleMaps(state, bytes) == 0) {
      return taken;
    }
  }
}
/// Builds the tree of `plan` from what `read` gives, with room taken for it, on the device's
/// thread. The errors of `read` and Builder::Build; RESOURCE_EXHAUSTED: there is no room.
absl::StatusOr<std::shared_ptr<const ResidentTree>> LoadTree(State& state, const BuildPlan& plan,
                                                             const ReloadableMap::ReadFrom& read,
                                                             const CancelCheck& cancelled);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_RESIDENCY_H_
