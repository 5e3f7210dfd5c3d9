#ifndef TREELIGHT_CORE_CPU_WHOLE_SUM_H_
#define TREELIGHT_CORE_CPU_WHOLE_SUM_H_

#include <array>

#include "core/gatherer.h"
#include "core/model/tree.h"

namespace treelight {

/// A kernel of densities as a line in s = (d / R)^2 over the distances of one subtree:
/// weight = constant + slope * s, relative to the constant kernel.
struct LinearWeight {
  float constant = 0, slope = 0;
  float error = 0;  ///< largest difference from the kernel
};

/// The line for distances of which `near_s` and `far_s` <= 1 are the smallest and the largest s.
/// The constant kernel and Epanechnikov's are lines; of the cone's square root it is the chord,
/// moved so that it errs as far to either side: by (b - a)^2 / (8 (a + b)), where a and b are the
/// roots of the ends.
LinearWeight Linearise(DensityKernel kernel, float near_s, float far_s);

/// The largest weight of a kernel.
float PeakWeight(DensityKernel kernel);

/// Sum of weight * power over the photons of a subtree, and how far it may be from the kernel's.
struct WholeSum {
  std::array<float, 3> sums{};
  float error = 0;  ///< of each channel
};

/// Adds up a kernel over a subtree without a look at its photons (compare Gray and Moore 2003,
/// "Nonparametric Density Estimation: Toward Computational Tractability", who bound the kernel over
/// a node; moments make lines exact).
/// @param box      of the subtree
/// @param radius   of the gather, > 0
WholeSum SumOf(const PowerMoments& moments, const Box& box, const Vec3& center, float radius,
               const LinearWeight& weight);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_WHOLE_SUM_H_
