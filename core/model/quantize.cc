#include "core/model/quantize.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace treelight {
namespace {

constexpr double kLargestOffset = 65535;

/// Between two offsets of an axis.
double Step(const Box& box, int axis) {
  return (double{Component(box.max, axis)} - Component(box.min, axis)) / kLargestOffset;
}

}  // namespace

QuantizedPositions Quantize(std::span<const float> positions) {
  QuantizedPositions quantized;
  for (std::size_t i = 0; i < positions.size(); i += 3) {
    quantized.box.Extend(Vec3{positions[i], positions[i + 1], positions[i + 2]});
  }
  quantized.offsets.resize(positions.size());
  for (int axis = 0; axis < 3; ++axis) {
    const double smallest = Component(quantized.box.min, axis), step = Step(quantized.box, axis);
    if (step == 0) continue;
    for (auto i = static_cast<std::size_t>(axis); i < positions.size(); i += 3) {
      const double offset = std::min(kLargestOffset, (positions[i] - smallest) / step + 0.5);
      quantized.offsets[i] = static_cast<std::uint16_t>(offset);
    }
  }
  return quantized;
}

void AppendPositions(const Box& box, std::span<const std::uint16_t> offsets,
                     std::vector<float>& positions) {
  const std::size_t size = positions.size();
  positions.resize(size + offsets.size());
  for (int axis = 0; axis < 3; ++axis) {
    const double smallest = Component(box.min, axis), step = Step(box, axis);
    const float largest = Component(box.max, axis);
    for (auto i = static_cast<std::size_t>(axis); i < offsets.size(); i += 3) {
      // Not beyond the box by a rounding of the step.
      positions[size + i] = std::min(static_cast<float>(smallest + offsets[i] * step), largest);
    }
  }
}

float LargestMove(const Box& box) {
  double square = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const double step = Step(box, axis);
    if (step == 0) continue;
    const double farthest = std::max(std::fabs(double{Component(box.min, axis)}),
                                     std::fabs(double{Component(box.max, axis)}));
    const double move = step / 2 + 0x1p-24 * farthest;
    square += move * move;
  }
  // Above the roundings of the sum.
  return square == 0 ? 0
                     : std::nextafter(static_cast<float>(std::sqrt(square) * (1 + 0x1p-20)),
                                      std::numeric_limits<float>::infinity());
}

}  // namespace treelight
