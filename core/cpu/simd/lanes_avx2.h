#ifndef TREELIGHT_CORE_CPU_SIMD_LANES_AVX2_H_
#define TREELIGHT_CORE_CPU_SIMD_LANES_AVX2_H_

#include <immintrin.h>

#include <array>
#include <cstdint>

namespace treelight {
namespace {

/// Of each mask of 8 lanes, where the lanes that are kept come from.
struct CompressTable {
  alignas(32) std::array<std::array<std::uint32_t, 8>, 256> from{};

  constexpr CompressTable() {
    for (std::uint32_t mask = 0; mask < 256; ++mask) {
      std::uint32_t kept = 0;
      for (std::uint32_t lane = 0; lane < 8; ++lane) {
        if ((mask >> lane & 1) != 0) from[mask][kept++] = lane;
      }
    }
  }
};

constexpr CompressTable kCompress;

/// PlainLanes by AVX2.
struct Avx2Lanes {
  static constexpr std::uint32_t kWidth = 8;
  using Mask = std::uint32_t;
  using Floats = __m256;
  using Uints = __m256i;

  static Floats All(float value) { return _mm256_set1_ps(value); }
  static Floats Load(const float* from) { return _mm256_loadu_ps(from); }
  static Uints Load(const std::uint32_t* from) {
    return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(from));
  }
  static void Store(Floats a, float* to) { _mm256_storeu_ps(to, a); }

  static Floats Add(Floats a, Floats b) { return _mm256_add_ps(a, b); }
  static Floats Subtract(Floats a, Floats b) { return _mm256_sub_ps(a, b); }
  static Floats Multiply(Floats a, Floats b) { return _mm256_mul_ps(a, b); }
  static Floats Max(Floats a, Floats b) { return _mm256_max_ps(a, b); }

  static Mask LessEqual(Floats a, Floats b) {
    return static_cast<Mask>(_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LE_OQ)));
  }
  static Mask Less(Floats a, Floats b) {
    return static_cast<Mask>(_mm256_movemask_ps(_mm256_cmp_ps(a, b, _CMP_LT_OQ)));
  }

  static void Compress(Floats a, Mask mask, float* to) {
    _mm256_storeu_ps(to, _mm256_permutevar8x32_ps(a, Load(kCompress.from[mask].data())));
  }
  static void Compress(Uints a, Mask mask, std::uint32_t* to) {
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to),
                        _mm256_permutevar8x32_epi32(a, Load(kCompress.from[mask].data())));
  }

  static std::uint32_t SumOf(Uints a, Mask mask) {
    alignas(32) std::uint32_t kept[kWidth];
    Compress(a, mask, kept);
    std::uint32_t sum = 0;
    for (int i = 0; i < __builtin_popcount(mask); ++i) sum += kept[i];
    return sum;
  }
};

}  // namespace
}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SIMD_LANES_AVX2_H_
