#ifndef TREELIGHT_CORE_MODEL_QUANTIZE_H_
#define TREELIGHT_CORE_MODEL_QUANTIZE_H_

#include <cstdint>
#include <span>
#include <vector>

#include "core/model/box.h"

// Positions in half the bytes: 16-bit offsets in a box. Offset o of an axis stands for
//   smallest + o * (largest - smallest) / 65535
// in double, rounded to float32.
namespace treelight {

/// Positions as the nearest offsets.
struct QuantizedPositions {
  Box box;                             ///< tight
  std::vector<std::uint16_t> offsets;  ///< [3n]
};

/// @param positions  [3n], n > 0, scene units, finite, within kMaxCoordinate
QuantizedPositions Quantize(std::span<const float> positions);

/// Appends the positions that `offsets` [3n] stand for. They lie in `box`.
void AppendPositions(const Box& box, std::span<const std::uint16_t> offsets,
                     std::vector<float>& positions);

/// How far a position may be from the one that is appended for its nearest offsets, at most, scene
/// units: half the diagonal of a step, and the rounding to float32.
float LargestMove(const Box& box);

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_QUANTIZE_H_
