#ifndef TREELIGHT_CORE_ERROR_SAMPLE_H_
#define TREELIGHT_CORE_ERROR_SAMPLE_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/gatherer.h"

// What a sample of a batch tells of the error of the whole: the root mean square of
// |density / exact density - 1|, of the sum of the channels; 0 where both are 0, 1 where only the
// exact one is.
namespace treelight {

/// Queries to sample of a batch whose error is to be within `error`: one in 32, at most 4096, but
/// so many that what they may have missed takes half of the error at most; `error` 0: none is asked
/// for.
std::size_t SampleSize(const GatherQueries& queries, double error);

/// `count` of `query_count` queries: one of each run of neighbours, which may be in the order of a
/// picture, at a place that is drawn.
std::vector<std::uint32_t> SampledQueries(std::size_t query_count, std::size_t count);

struct SampledError {
  double measured = 0;  ///< of the sample
  /// What that of the batch is taken to be at most: with three standard errors of the mean square,
  /// and queries that the sample may have missed (the rule of three).
  double limit = 0;
};

/// Of the answers to a sample of `queries`, with densities.
SampledError ErrorOf(const GatherResult& answer, const GatherResult& exact,
                     const GatherQueries& queries);

}  // namespace treelight

#endif  // TREELIGHT_CORE_ERROR_SAMPLE_H_
