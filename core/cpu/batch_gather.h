#ifndef TREELIGHT_CORE_CPU_BATCH_GATHER_H_
#define TREELIGHT_CORE_CPU_BATCH_GATHER_H_

#include "absl/status/statusor.h"
#include "core/cpu/simd/packed_search.h"
#include "core/gatherer.h"

namespace treelight {

/// Answers checked queries by `search`, all but kOutputStatistics, by TBB in the arena of the
/// caller. Many queries are worked on in Morton order, in pieces of a size that does not depend on
/// the threads, so that the answers are the same bits for any number of them. CANCELLED and
/// RESOURCE_EXHAUSTED as Gatherer::Gather.
/// @param photons  what the tree was built over
/// @param bounds   of the photons
absl::StatusOr<GatherResult> GatherBatch(const PackedSearch& search, const Photons& photons,
                                         const Box& bounds, const GatherQueries& queries,
                                         const GatherOptions& options,
                                         const CancelCheck& cancelled);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_BATCH_GATHER_H_
