#ifndef TREELIGHT_CORE_GPU_WIDE_SEARCH_H_
#define TREELIGHT_CORE_GPU_WIDE_SEARCH_H_

#include <cstddef>

#include "core/gatherer.h"
#include "core/gpu/batch_buffers.h"
#include "core/gpu/device_map.h"
#include "core/gpu/paced_launches.h"
#include "core/kernels/types.h"

namespace treelight {

/// Searches of one batch by sub-groups that walk the wide tree, which the map has. Each enqueues
/// all of the batch, and throws, as PacedLaunches.
struct WideSearch {
  const DeviceMap& map;
  const BatchBuffers& batch;
  GatherParams params;
  std::size_t count;  ///< queries
  LaunchPace& pace;
  const CancelCheck& cancelled;

  /// The k nearest, k up to kMaxWideK: lists of a few queries to a sub-group.
  void GatherWide() const;
  /// The k nearest, of any k: a list to a sub-group.
  void GatherLong() const;
  /// Counts within a radius.
  void CountWide() const;
  /// Densities within a radius, photon by photon.
  void DensityWide() const;

 private:
  template <typename LaunchPart>
  void InParts(const WidePrograms& programs, const WideVariants& variants,
               LaunchPart&& launch) const;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_WIDE_SEARCH_H_
