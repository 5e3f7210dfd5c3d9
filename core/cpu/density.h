#ifndef TREELIGHT_CORE_CPU_DENSITY_H_
#define TREELIGHT_CORE_CPU_DENSITY_H_

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "core/gatherer.h"
#include "core/model/octahedral.h"

namespace treelight {

/// Adds up the density estimate of one query, photon by photon, in double, so that the float sums
/// of devices can be judged by it (Jensen 1996; the kernels of DensityKernel).
class DensitySum {
 public:
  /// @param normal  3 numbers, or null: photons are not judged by their direction
  /// @param radius  of the gather, scene units; where its square, as float32 has it, is 0 or
  ///   infinite the density is 0
  DensitySum(const Photons& photons, const float* normal, DensityKernel kernel, float radius)
      : photons_(photons),
        normal_(normal),
        kernel_(kernel),
        squared_radius_(double{radius} * radius),
        is_empty_(!(radius * radius > 0) || std::isinf(radius * radius)) {}

  void Add(float squared_distance, std::uint32_t id) {
    if (is_empty_ || (normal_ != nullptr && !Faces(id))) return;
    const double weight = std::max(0.0, Weight(squared_distance / squared_radius_));
    const float* const power = &photons_.powers[3 * std::size_t{id}];
    for (int c = 0; c < 3; ++c) sum_[c] += weight * power[c];
  }

  /// Adds photons that were added up: weight * power of each channel.
  void AddWhole(const std::array<double, 3>& sums) {
    for (std::size_t c = 0; c < 3; ++c) sum_[c] += sums[c];
  }

  /// W / unit^2 of a sum of weight * power.
  float PerArea(double sum) const {
    return is_empty_ ? 0 : static_cast<float>(sum / (std::numbers::pi * squared_radius_));
  }

  /// Writes W / unit^2, RGB.
  void Write(float* density) const {
    for (int c = 0; c < 3; ++c) density[c] = PerArea(sum_[c]);
  }

 private:
  bool Faces(std::uint32_t id) const {
    return ComesAgainst(&photons_.directions[2 * std::size_t{id}], normal_);
  }

  /// Of a photon at t2 = (d / R)^2, relative to the constant kernel.
  double Weight(double t2) const {
    switch (kernel_) {
      case DensityKernel::kConstant:
        return 1;
      case DensityKernel::kCone:
        return 3 * (1 - std::sqrt(t2));
      case DensityKernel::kEpanechnikov:
        return 2 * (1 - t2);
    }
    return 0;
  }

  const Photons& photons_;
  const float* const normal_;
  const DensityKernel kernel_;
  const double squared_radius_;
  const bool is_empty_;
  double sum_[3] = {0, 0, 0};
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_DENSITY_H_
