#ifndef TREELIGHT_SERVER_ROOM_H_
#define TREELIGHT_SERVER_ROOM_H_

#include <cstdint>
#include <memory>
#include <string_view>

#include "absl/status/statusor.h"
#include "server/convert.h"
#include "server/state.h"

// Room for maps and for what calls keep: where there is too little, maps that nobody uses and that
// can come back leave the device, those first that were not used for the longest time.
namespace treelight::server {

/// Host memory, for which maps of a CPU leave. May take long: photons that are nowhere else are
/// copied. The errors of MemoryBudget::Take.
absl::StatusOr<MemoryBudget::Share> TakeHostMemory(State& state, Holder holder, std::uint64_t bytes,
                                                   std::string_view what);

/// The same for what a call keeps, from a thread that must not be held up: only maps leave whose
/// photons are kept anyway.
absl::StatusOr<MemoryBudget::Share> TakeForCall(State& state, Holder holder, std::uint64_t bytes,
                                                std::string_view what);

/// Room on the device for a map of `plan`, for which others leave. OK where ServerOptions tells of
/// no device. The errors of CheckDeviceRoom.
absl::Status MakeDeviceRoom(State& state, const BuildPlan& plan, std::string_view what);

/// Builds a map of `plan` with `options`, on the device's thread; where the device has no memory
/// left, others leave it. The errors of Builder::Build.
absl::StatusOr<std::unique_ptr<Gatherer>> BuildWithRoom(State& state, const Photons& photons,
                                                        const BuildPlan& plan,
                                                        const BuildOptions& options,
                                                        const CancelCheck& cancelled);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_ROOM_H_
