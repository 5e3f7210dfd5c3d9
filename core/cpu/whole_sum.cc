#include "core/cpu/whole_sum.h"

#include <cmath>

#include "core/model/power_moments.h"

namespace treelight {

LinearWeight Linearise(DensityKernel kernel, float near_s, float far_s) {
  switch (kernel) {
    case DensityKernel::kConstant:
      return {.constant = 1, .slope = 0, .error = 0};
    case DensityKernel::kEpanechnikov:
      return {.constant = 2, .slope = -2, .error = 0};
    case DensityKernel::kCone:
      break;
  }
  const float a = std::sqrt(near_s), b = std::sqrt(far_s), sum = a + b;
  if (sum == 0) return {.constant = 3, .slope = 0, .error = 0};
  const float error = (b - a) * (b - a) / (8 * sum);
  return {.constant = 3 * (1 - a * b / sum - error), .slope = -3 / sum, .error = 3 * error};
}

float PeakWeight(DensityKernel kernel) {
  return kernel == DensityKernel::kConstant ? 1.0f : kernel == DensityKernel::kCone ? 3.0f : 2.0f;
}

WholeSum SumOf(const PowerMoments& moments, const Box& box, const Vec3& center, float radius,
               const LinearWeight& weight) {
  // With u = (middle - query) / R and offsets in units of the unit e:
  // sum of power * s = |u|^2 sum + 2 (e / R) (u . first) + (e / R)^2 square.
  const float scale = 1 / radius, unit = MomentsUnit(box) * scale;
  const Vec3 middle = MomentsCenter(box);
  const Vec3 u = {(middle.x - center.x) * scale, (middle.y - center.y) * scale,
                  (middle.z - center.z) * scale};
  const float squared = (u.x * u.x + u.y * u.y) + u.z * u.z;
  WholeSum whole;
  for (std::size_t c = 0; c < 3; ++c) {
    const float* const m = moments.channels[c];
    const float first = (u.x * m[1] + u.y * m[2]) + u.z * m[3];
    const float s = (squared * m[0] + 2 * unit * first) + unit * unit * m[4];
    whole.sums[c] = weight.constant * m[0] + weight.slope * s;
  }
  whole.error = weight.error * moments.absolute;
  return whole;
}

}  // namespace treelight
