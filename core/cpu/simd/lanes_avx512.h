#ifndef TREELIGHT_CORE_CPU_SIMD_LANES_AVX512_H_
#define TREELIGHT_CORE_CPU_SIMD_LANES_AVX512_H_

#include <immintrin.h>

#include <cstdint>

namespace treelight {
namespace {

/// PlainLanes by AVX-512 (F, DQ, VL, BW).
struct Avx512Lanes {
  static constexpr std::uint32_t kWidth = 16;
  using Mask = std::uint32_t;
  using Floats = __m512;
  using Uints = __m512i;

  static Floats All(float value) { return _mm512_set1_ps(value); }
  static Floats Load(const float* from) { return _mm512_loadu_ps(from); }
  static Uints Load(const std::uint32_t* from) { return _mm512_loadu_si512(from); }
  static void Store(Floats a, float* to) { _mm512_storeu_ps(to, a); }

  static Floats Add(Floats a, Floats b) { return _mm512_add_ps(a, b); }
  static Floats Subtract(Floats a, Floats b) { return _mm512_sub_ps(a, b); }
  static Floats Multiply(Floats a, Floats b) { return _mm512_mul_ps(a, b); }
  static Floats Max(Floats a, Floats b) { return _mm512_max_ps(a, b); }

  static Mask LessEqual(Floats a, Floats b) { return _mm512_cmp_ps_mask(a, b, _CMP_LE_OQ); }
  static Mask Less(Floats a, Floats b) { return _mm512_cmp_ps_mask(a, b, _CMP_LT_OQ); }

  // Compressed in a register: some processors take a hundred cycles to compress to memory.
  static void Compress(Floats a, Mask mask, float* to) {
    _mm512_storeu_ps(to, _mm512_maskz_compress_ps(static_cast<__mmask16>(mask), a));
  }
  static void Compress(Uints a, Mask mask, std::uint32_t* to) {
    _mm512_storeu_si512(to, _mm512_maskz_compress_epi32(static_cast<__mmask16>(mask), a));
  }

  static std::uint32_t SumOf(Uints a, Mask mask) {
    return static_cast<std::uint32_t>(
        _mm512_mask_reduce_add_epi32(static_cast<__mmask16>(mask), a));
  }
};

}  // namespace
}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SIMD_LANES_AVX512_H_
