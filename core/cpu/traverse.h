#ifndef TREELIGHT_CORE_CPU_TRAVERSE_H_
#define TREELIGHT_CORE_CPU_TRAVERSE_H_

#include <cstdint>
#include <vector>

#include "core/cpu/answers.h"
#include "core/cpu/whole_sum.h"
#include "core/model/tree.h"

namespace treelight {

/// The searches of kernels/gather_nearest.cl and gather_range.cl in plain C++: the same rules, so
/// the same photons, the same nodes visited and the same distance tests.

/// The k nearest photons within `radius`: depth-first, the nearer child first; a subtree is visited
/// where its (box distance, smallest photon index) is below the k-th candidate so far.
/// Once there are k candidates, `approximation` stretches the distances of boxes, and ends the
/// search after so many leaves.
/// @param k  > 0
QueryAnswer FindNearest(const Tree& tree, const Vec3& center, std::uint32_t k, float radius,
                        const Approximation& approximation = {});

/// Whether a subtree that lies within the radius whole is visited, or only its size counted.
enum class WholeSubtrees { kVisited, kCounted };

/// All photons within `radius`. The visits are those of a count, where kCounted; the photons are
/// found all the same.
QueryAnswer FindWithin(const Tree& tree, const Vec3& center, float radius, WholeSubtrees whole);

/// What whole subtrees are added up by.
struct SumOptions {
  const std::vector<PowerMoments>& moments;  ///< of the tree
  DensityKernel kernel;
  float weight_tolerance;
};

/// All photons within `radius`, for a density: whole subtrees are added up as
/// Approximation::weight_tolerance says, like kernels/gather_sums.cl does it. The photons are found
/// all the same.
QueryAnswer SumWithin(const Tree& tree, const Vec3& center, float radius,
                      const SumOptions& options);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_TRAVERSE_H_
