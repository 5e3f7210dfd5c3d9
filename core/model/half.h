#ifndef TREELIGHT_CORE_MODEL_HALF_H_
#define TREELIGHT_CORE_MODEL_HALF_H_

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

// Numbers in half the bytes: IEEE 754 binary16 with a scale for each array, so that large and small
// ones fit.
namespace treelight {

/// Largest relative error of a number as a half: half a unit in the last of 11 digits.
inline constexpr float kHalfError = 0x1p-11f;

/// Numbers as halves times `scale`.
struct Halves {
  std::vector<std::uint16_t> numbers;  ///< bits of binary16; NaN and infinities stay such
  float scale = 1;                     ///< a power of two, [2^-126, 2^113]
  /// Numbers other than 0 that are smaller than 2^-14 * scale, about 2^-28 of the largest: what
  /// they are off by is not kHalfError of them but up to 2^-25 * scale.
  std::size_t small_count = 0;
};

/// Rounds to the nearest half, ties to even. The scale brings the largest finite magnitude to
/// [2^14, 2^15), so that none overflows; one below 2^-112, as near to that as 2^-126 does, which
/// loses nothing, since no float32 has a digit below 2^-149.
Halves ToHalves(std::span<const float> numbers);

/// Appends scale * halves to `numbers`. Halves of a scale that ToHalves chose do not overflow.
void AppendFromHalves(std::span<const std::uint16_t> halves, float scale,
                      std::vector<float>& numbers);

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_HALF_H_
