#include "server/room.h"

#include <algorithm>
#include <chrono>
#include <functional>
#include <limits>
#include <vector>

#include "server/upload.h"

namespace treelight::server {
namespace {

/// Which maps may leave.
enum class Leaving {
  kAll,  ///< photons that are nowhere else are copied, which may take long and wait for the device
  kAtOnce,  ///< those alone whose photons are kept anyway: for threads that must not be held up
};

/// Lets maps that nobody uses leave the device until they have held `bytes` together; none where
/// all of them hold less than `least`. What they held, 0 where none has left.
std::uint64_t EvictIdleMaps(State& state, std::uint64_t bytes, std::uint64_t least,
                            Leaving leaving) {
  struct Idle {
    std::chrono::steady_clock::time_point last_use;
    const ReloadableMap* map;
  };
  const std::vector<MapHandle> maps = state.store.List();
  std::uint64_t held = 0;
  std::vector<Idle> idle;
  for (const MapHandle& map : maps) {
    held += map->merged->idle_bytes();
    const ReloadableMap* const reloadable = map->reloadable;
    if (reloadable == nullptr || (leaving == Leaving::kAtOnce && !reloadable->leaves_at_once())) {
      continue;
    }
    held += reloadable->idle_bytes();
    idle.push_back({reloadable->last_use(), reloadable});
  }
  if (held < least) return 0;  // whoever needs them would come for nothing
  std::uint64_t freed = 0;
  for (const MapHandle& map : maps) freed += map->merged->Drop();
  std::ranges::sort(idle, {}, &Idle::last_use);
  for (const Idle& entry : idle) {
    if (freed >= bytes) break;
    if (const auto tree = entry.map->Evict()) freed += tree->gatherer->report().device_bytes;
  }
  return freed;
}

/// The status of either kind of result.
const absl::Status& StatusOf(const absl::Status& status) { return status; }
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

/// What `take` returns; as long as that is RESOURCE_EXHAUSTED and idle maps can leave, they do, for
/// what is missing of `bytes`, and it is called again. None leaves where all that are idle hold too
/// little.
template <typename Take>
auto WithEviction(State& state, std::uint64_t bytes, const Space& space, Take take,
                  Leaving leaving) {
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

/// The host's memory; of no size on a device with memory of its own, where maps that leave give
/// back none of the host's.
Space HostSpace(const State& state) {
  if (!state.maps_in_host_memory()) return {.all_bytes = 0};
  return {.all_bytes = state.memory.room_bytes(),
          .free_bytes = [&memory = state.memory] { return memory.free_bytes(); }};
}

/// The memory of the server's device, for a map of `plan`; of no size where it could never hold it.
Space DeviceSpace(const State& state, const DeviceInfo& device, const BuildPlan& plan) {
  if (!CheckDeviceRoom(plan, device, 0, plan.name, {}).ok()) return {.all_bytes = 0};
  const auto free_bytes = [&state, &device] {
    const std::uint64_t used = DeviceBytes(state.store.List());
    return device.memory_bytes - std::min(device.memory_bytes, used);
  };
  return {.free_bytes = free_bytes, .needed_bytes = DeviceBytes(plan)};
}

absl::StatusOr<MemoryBudget::Share> TakeMemory(State& state, Holder holder, std::uint64_t bytes,
                                               std::string_view what, Leaving leaving) {
  const auto take = [&] {
    return state.memory.Take(holder, bytes, what, state.device_queue.RetryDelay());
  };
  return WithEviction(state, bytes, HostSpace(state), take, leaving);
}

}  // namespace

absl::StatusOr<MemoryBudget::Share> TakeHostMemory(State& state, Holder holder, std::uint64_t bytes,
                                                   std::string_view what) {
  return TakeMemory(state, holder, bytes, what, Leaving::kAll);
}

absl::StatusOr<MemoryBudget::Share> TakeForCall(State& state, Holder holder, std::uint64_t bytes,
                                                std::string_view what) {
  if (bytes == 0) return MemoryBudget::Share();
  return TakeMemory(state, holder, bytes, what, Leaving::kAtOnce);
}

absl::Status MakeDeviceRoom(State& state, const BuildPlan& plan, std::string_view what) {
  if (state.options.devices.empty()) return absl::OkStatus();
  const DeviceInfo& device = state.options.devices[state.options.device_index];
  const auto check = [&] {
    return CheckDeviceRoom(plan, device, DeviceBytes(state.store.List()), what,
                           state.device_queue.RetryDelay());
  };
  return WithEviction(state, MapBytes(plan), DeviceSpace(state, device, plan), check,
                      Leaving::kAll);
}

absl::StatusOr<std::unique_ptr<Gatherer>> BuildWithRoom(State& state, const Photons& photons,
                                                        const BuildPlan& plan,
                                                        const BuildOptions& options,
                                                        const CancelCheck& cancelled) {
  const auto build = [&] { return state.builder->Build(photons, options, cancelled); };
  return WithEviction(state, MapBytes(plan), Space{}, build, Leaving::kAll);
}

}  // namespace treelight::server
