#ifndef TREELIGHT_SERVER_GATHER_TOGETHER_H_
#define TREELIGHT_SERVER_GATHER_TOGETHER_H_

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/gatherer.h"

// Batches of a few queries that go to the device together: a launch costs more than they do.
namespace treelight::server {

/// Queries of a batch that may go with others, at most.
inline constexpr std::size_t kFewQueries = 64;

/// What batches of `map` have in common that may go together; empty where this one goes alone:
/// more than kFewQueries, lists without a cap, approximations.
std::string TogetherKey(const Gatherer& map, const GatherQueries& queries,
                        const GatherOptions& options);

/// Gathers the queries of all `batches`, which have one key, as one batch, and gives each its own
/// part of the answer, the same bits as if it were alone; the times are those of the launch. The
/// errors of Gatherer::Gather.
absl::StatusOr<std::vector<GatherResult>> GatherTogether(const Gatherer& map,
                                                         std::span<const GatherQueries> batches,
                                                         const GatherOptions& options,
                                                         const CancelCheck& cancelled = {});

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_GATHER_TOGETHER_H_
