#include "client/render/shrinking_radius.h"

#include <algorithm>
#include <cmath>

namespace treelight::client {

void ShrinkingRadius::Advance() {
  const auto i = static_cast<double>(pass_);
  if (pass_++ < constant_passes_) return;
  squared_scale_ *= (i + kRadiusAlpha) / (i + 1);
}

EstimateOptions Shrink(const EstimateOptions& first, double squared_scale) {
  EstimateOptions estimate = first;
  estimate.radius = static_cast<float>(first.radius * std::sqrt(squared_scale));
  if (first.k > 0) {
    const auto k = static_cast<std::uint32_t>(std::lround(first.k * squared_scale));
    estimate.k = std::max(k, std::min(first.k, kMinShrunkNeighbors));
  }
  return estimate;
}

}  // namespace treelight::client
