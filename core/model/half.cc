#include "core/model/half.h"

#include <algorithm>
#include <bit>
#include <cmath>

#ifdef __x86_64__
#include <cpuid.h>
#endif

namespace treelight {
namespace {

static_assert(sizeof(_Float16) == sizeof(std::uint16_t));

// The compiler's conversions, in loops that it makes vectors of where the processor has them.
[[gnu::always_inline]] inline void Round(std::span<const float> numbers, float inverse_scale,
                                         std::uint16_t* halves) {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    halves[i] = std::bit_cast<std::uint16_t>(static_cast<_Float16>(numbers[i] * inverse_scale));
  }
}

[[gnu::always_inline]] inline void Widen(std::span<const std::uint16_t> halves, float scale,
                                         float* numbers) {
  for (std::size_t i = 0; i < halves.size(); ++i) {
    numbers[i] = scale * static_cast<float>(std::bit_cast<_Float16>(halves[i]));
  }
}

#ifdef __x86_64__
bool HasF16c() {
  unsigned a = 0, b = 0, c = 0, d = 0;
  static const bool has =
      __builtin_cpu_supports("avx2") && __get_cpuid(1, &a, &b, &c, &d) != 0 && (c & bit_F16C) != 0;
  return has;
}

[[gnu::target("avx2,f16c")]] void RoundByF16c(std::span<const float> numbers, float inverse_scale,
                                              std::uint16_t* halves) {
  Round(numbers, inverse_scale, halves);
}

[[gnu::target("avx2,f16c")]] void WidenByF16c(std::span<const std::uint16_t> halves, float scale,
                                              float* numbers) {
  Widen(halves, scale, numbers);
}
#endif

/// The scale of numbers of which `largest` is the largest.
float ScaleFor(float largest) {
  if (largest == 0) return 1;
  int exponent = 0;
  std::frexp(largest, &exponent);  // largest is in [2^(exponent - 1), 2^exponent)
  // Subnormal numbers times 2^126 are halves as they are.
  return std::ldexp(1.0f, std::max(exponent - 15, -126));
}

}  // namespace

Halves ToHalves(std::span<const float> numbers) {
  float largest = 0;
  for (const float number : numbers) {
    const float magnitude = std::fabs(number);
    if (magnitude > largest && std::isfinite(magnitude)) largest = magnitude;
  }
  Halves halves{.numbers = std::vector<std::uint16_t>(numbers.size()), .scale = ScaleFor(largest)};
  const float smallest = 0x1p-14f * halves.scale;  // that has all digits
  for (const float number : numbers) {
    halves.small_count += number != 0 && std::fabs(number) < smallest ? 1 : 0;
  }
  const float inverse_scale = 1 / halves.scale;  // exact
#ifdef __x86_64__
  if (HasF16c()) {
    RoundByF16c(numbers, inverse_scale, halves.numbers.data());
    return halves;
  }
#endif
  Round(numbers, inverse_scale, halves.numbers.data());
  return halves;
}

void AppendFromHalves(std::span<const std::uint16_t> halves, float scale,
                      std::vector<float>& numbers) {
  const std::size_t size = numbers.size();
  numbers.resize(size + halves.size());
#ifdef __x86_64__
  if (HasF16c()) return WidenByF16c(halves, scale, numbers.data() + size);
#endif
  Widen(halves, scale, numbers.data() + size);
}

}  // namespace treelight
