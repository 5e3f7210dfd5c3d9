#ifndef TREELIGHT_CORE_GPU_TIES_H_
#define TREELIGHT_CORE_GPU_TIES_H_

#include "core/builder.h"
#include "core/device/buffer.h"
#include "core/gpu/gpu.h"

namespace treelight {

/// Does what BreakTies does where sub-groups can, in one round (ties_short.cl). Needs sub-groups.
/// Returns [1], which is not 0 where BreakTies has to go on. Does not wait.
Buffer<cl_uint> BreakShortTies(const Gpu& gpu, const Buffer<float>& positions, std::size_t count,
                               unsigned code_bits, std::uint32_t max_leaf_size,
                               const Buffer<cl_uint>& ids, const Buffer<cl_uchar>& levels);

/// What BreakTies had to do for all runs at once, beside those that sub-groups rebuilt.
struct TieReport {
  std::size_t tied_photons = 0;  ///< in runs of equal codes longer than a leaf, at first
  unsigned code_rounds = 0;      ///< finer codes within each run's box
  unsigned median_rounds = 0;    ///< splits at the median of what was still tied
};

/// Rebuilds runs of more than `max_leaf_size` equal codes by position and replaces every kLevelTied
/// (ties.cl; BreakShortTies before it where there are sub-groups). The depth stays within
/// kMaxDepth: codes give at most 93 levels, medians and places at most 34.
/// @param ids     [count] in/out: photon at each place of the leaf order
/// @param levels  [count - 1] in/out: of ComputeSplitLevels, with `code_bits` bits
/// Waits once for each round. CANCELLED is thrown as StatusError where `cancelled` says so.
TieReport BreakTies(const Gpu& gpu, const Buffer<float>& positions, std::size_t count,
                    unsigned code_bits, std::uint32_t max_leaf_size, const Buffer<cl_uint>& ids,
                    const Buffer<cl_uchar>& levels, const CancelCheck& cancelled);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_TIES_H_
