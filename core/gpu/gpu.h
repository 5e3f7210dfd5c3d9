#ifndef TREELIGHT_CORE_GPU_GPU_H_
#define TREELIGHT_CORE_GPU_GPU_H_

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

/// The largest k that the lists of gather_wide can hold: (LIST_ROWS - 2) * 32.
inline constexpr std::uint32_t kMaxWideK = 64;

/// How a kernel is compiled whose sub-groups walk the wide tree, each for several neighbouring
/// queries together.
struct WideVariant {
  std::size_t queries;  ///< of one sub-group; the kernels' QUERIES
  /// Groups that one multiprocessor of an H200 works on at once where it is fastest: with fewer
  /// registers each than the compiler takes, up to where they spill too much.
  unsigned resident;
};

/// For batches of many queries and of few.
struct WideVariants {
  WideVariant many, few;
};
inline constexpr WideVariants kGatherWideVariants = {{4, 21}, {1, 28}};
inline constexpr WideVariants kCountWideVariants = {{8, 21}, {2, 21}};
inline constexpr WideVariants kDensityWideVariants = {{4, 21}, {1, 28}};

/// Places of a list up to which gather_long has two sub-groups in a work-group, and how many groups
/// one multiprocessor of an H200 then works on at once.
inline constexpr std::size_t kLongPairPlaces = 768;
inline constexpr unsigned kLongPairsResident = 24;

/// Work-items of a work-group of the one-sweep sort, and pairs of one of them.
inline constexpr std::size_t kSweepGroupSize = 384;
template <typename Key>
inline constexpr std::size_t kSweepItems = sizeof(Key) == 4 ? 16 : 8;

/// Likewise of the one-sweep sort.
template <typename Key>
inline constexpr unsigned kSweepResident = sizeof(Key) == 4 ? 0 : 3;

/// The variants of one such kernel.
struct WidePrograms {
  cl::Program many, few;
};

/// A device with the compiled kernels of all stages. Cheap to copy.
struct Gpu {
  std::shared_ptr<Device> device;
  cl::Program stages;  ///< bounds, morton, split_levels, ties, leaves, hierarchy, statistics, scan,
                       ///< photon_powers
  cl::Program sort_32;           ///< radix_sort of 32-bit keys
  cl::Program sort_64;           ///< radix_sort of 64-bit keys
  cl::Program gather;            ///< gather_nearest with heaps in local memory, gather_range
  cl::Program gather_global;     ///< gather_nearest with heaps in global memory, gather_list
  cl::Program sub_group_stages;  ///< this and those that follow: where there are sub-groups
  WidePrograms gather_wide, count_wide, density_wide;
  cl::Program gather_long;        ///< one sub-group to a work-group
  cl::Program gather_long_pairs;  ///< two

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
