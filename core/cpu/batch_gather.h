#ifndef TREELIGHT_CORE_CPU_BATCH_GATHER_H_
#define TREELIGHT_CORE_CPU_BATCH_GATHER_H_

#include <span>

#include "absl/status/statusor.h"
#include "core/cpu/simd/packed_search.h"
#include "core/gatherer.h"
#include "core/kernels/types.h"

namespace treelight {

/// What a batch is answered from.
struct SearchedMap {
  const PackedSearch& search;
  const Photons& photons;  ///< what the tree was built over; their positions are not read
  Box bounds;              ///< of the photons
  std::span<const PowerMoments> moments;  ///< of the tree; read where weight_tolerance > 0
};

/// Answers checked queries by `map`, all but kOutputStatistics, by TBB in the arena of the
/// caller. Many queries are worked on in Morton order, in pieces of a size that does not depend on
/// the threads, so that the answers are the same bits for any number of them. CANCELLED and
/// RESOURCE_EXHAUSTED as Gatherer::Gather.
absl::StatusOr<GatherResult> GatherBatch(const SearchedMap& map, const GatherQueries& queries,
                                         const GatherOptions& options,
                                         const CancelCheck& cancelled);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_BATCH_GATHER_H_
