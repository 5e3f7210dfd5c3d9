#ifndef TREELIGHT_CORE_GPU_GPU_H_
#define TREELIGHT_CORE_GPU_GPU_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>

#include "core/device/device.h"
#include "core/device/guard.h"

namespace treelight {

/// Work-items of a work-group of every kernel but the gathers; the kernels' GROUP_SIZE.
inline constexpr std::size_t kGroupSize = 256;

/// Consecutive items of one work-item; the kernels' SCAN_ITEMS, SORT_ITEMS and TIE_ITEMS.
inline constexpr std::size_t kScanItems = 8, kSortItems = 8, kTieItems = 16;

/// Work-items of a sub-group; the kernels' SUB_GROUP_SIZE.
inline constexpr std::size_t kSubGroupSize = 32;

/// Sub-groups of a work-group: not one, since the number of groups at once is limited too.
inline constexpr std::size_t kSubGroupsPerGroup = 2;

/// Photons of a run of equal codes that a sub-group rebuilds.
inline constexpr std::size_t kTieShortRun = 512;

/// Boundaries that one work-item of tie_short_runs looks at.
inline constexpr std::size_t kTieBoundaries = 8;

/// Lists of gather_wide in local memory: places / 32, and the largest k that they can hold.
inline constexpr std::array<std::uint32_t, 2> kListRows = {4, 6}, kListK = {64, 128};

/// Groups of gather_wide by length of the lists, and of count_wide, that one multiprocessor of an
/// H200 works on at once where it is fastest: with fewer registers each than the compiler takes, up
/// to where they spill too much.
inline constexpr std::array<unsigned, 2> kWideResident = {21, 0};
inline constexpr unsigned kCountResident = 21;

/// Queries of one sub-group of gather_wide.
inline constexpr std::size_t kWideQueries = 4;

/// Queries of one sub-group of count_wide.
inline constexpr std::size_t kCountQueries = 8;

/// Work-items of a work-group of the one-sweep sort, and pairs of one of them.
inline constexpr std::size_t kSweepGroupSize = 384;
template <typename Key>
inline constexpr std::size_t kSweepItems = sizeof(Key) == 4 ? 16 : 8;

/// Likewise of the one-sweep sort.
template <typename Key>
inline constexpr unsigned kSweepResident = sizeof(Key) == 4 ? 0 : 3;

/// A device with the compiled kernels of all stages. Cheap to copy.
struct Gpu {
  std::shared_ptr<Device> device;
  cl::Program stages;  ///< bounds, morton, split_levels, ties, leaves, hierarchy, statistics, scan,
                       ///< photon_powers
  cl::Program sort_32;           ///< radix_sort of 32-bit keys
  cl::Program sort_64;           ///< radix_sort of 64-bit keys
  cl::Program gather;            ///< gather_nearest with heaps in local memory, gather_range
  cl::Program gather_global;     ///< gather_nearest with heaps in global memory, gather_list
  cl::Program sub_group_stages;  ///< where there are sub-groups
  std::array<cl::Program, kListRows.size()> gather_wide;  ///< likewise; by length of the lists
  cl::Program count_wide;                                 ///< likewise

  BufferPool& memory() const { return device->memory(); }
  cl::CommandQueue& queue() const { return device->queue(); }
};

/// Opens device `index` of ListOpenClDevices and compiles the kernels, or takes them from the
/// cache. Throws as Device::Open.
Gpu OpenGpu(std::size_t index, const DeviceOptions& options);

/// Enqueues kernel `name` with at least `items` work-items, rounded up to whole work-groups of
/// `group_size`; nothing where items is 0. Throws cl::Error.
template <typename... Args>
void Launch(const Gpu& gpu, const cl::Program& program, const char* name, std::size_t items,
            std::size_t group_size, const Args&... args) {
  if (items == 0) return;
  const std::size_t padded = (items + group_size - 1) / group_size * group_size;
  cl::Kernel kernel(program, name);
  cl_uint index = 0;
  (kernel.setArg(index++, args), ...);
  // Without an event: on a queue that profiles, one costs more than the launch.
  gpu.queue().enqueueNDRangeKernel(kernel, cl::NullRange, cl::NDRange(padded),
                                   cl::NDRange(group_size));
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_GPU_H_
