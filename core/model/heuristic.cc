#include "core/model/heuristic.h"

#include <algorithm>
#include <cmath>

namespace treelight {

Measure::Measure(Heuristic heuristic, const Box& root, float radius) {
  auto& [prescale, scale, grow, volume] = params_;
  volume = heuristic == Heuristic::kVvh ? 1 : 0;
  const float longest =
      std::max({root.max.x - root.min.x, root.max.y - root.min.y, root.max.z - root.min.z});
  prescale = longest < 0x1p-60f ? 0x1p96f : 1.0f;  // the reciprocal of a denormal is infinite
  int exponent = 0;
  std::frexp(longest * prescale, &exponent);  // longest = mantissa in [0.5, 1) * 2^exponent
  scale = std::ldexp(1.0f, -exponent);
  if (heuristic != Heuristic::kSah) {
    grow = 2 * std::clamp((radius * prescale) * scale, 0x1p-20f, 0x1p20f);
  }
}

}  // namespace treelight
