#ifndef TREELIGHT_CORE_CPU_SIMD_LANES_PLAIN_H_
#define TREELIGHT_CORE_CPU_SIMD_LANES_PLAIN_H_

#include <cstdint>

namespace treelight {
namespace {

/// What searches ask of a vector of floats, in plain C++: for every processor, and to read what the
/// others do. A mask has bit i set where lane i holds; lanes are stored as they are, in order.
struct PlainLanes {
  static constexpr std::uint32_t kWidth = 8;
  using Mask = std::uint32_t;
  struct Floats {
    float lane[kWidth];
  };
  struct Uints {
    std::uint32_t lane[kWidth];
  };

  static Floats All(float value) {
    Floats out;
    for (float& lane : out.lane) lane = value;
    return out;
  }
  static Floats Load(const float* from) {
    Floats out;
    for (std::uint32_t i = 0; i < kWidth; ++i) out.lane[i] = from[i];
    return out;
  }
  static Uints Load(const std::uint32_t* from) {
    Uints out;
    for (std::uint32_t i = 0; i < kWidth; ++i) out.lane[i] = from[i];
    return out;
  }
  static void Store(const Floats& a, float* to) {
    for (std::uint32_t i = 0; i < kWidth; ++i) to[i] = a.lane[i];
  }

  static Floats Add(const Floats& a, const Floats& b) {
    return Each(a, b, [](float x, float y) { return x + y; });
  }
  static Floats Subtract(const Floats& a, const Floats& b) {
    return Each(a, b, [](float x, float y) { return x - y; });
  }
  static Floats Multiply(const Floats& a, const Floats& b) {
    return Each(a, b, [](float x, float y) { return x * y; });
  }
  static Floats Max(const Floats& a, const Floats& b) {
    return Each(a, b, [](float x, float y) { return x > y ? x : y; });
  }

  static Mask LessEqual(const Floats& a, const Floats& b) {
    Mask mask = 0;
    for (std::uint32_t i = 0; i < kWidth; ++i) mask |= Mask{a.lane[i] <= b.lane[i]} << i;
    return mask;
  }
  static Mask Less(const Floats& a, const Floats& b) {
    Mask mask = 0;
    for (std::uint32_t i = 0; i < kWidth; ++i) mask |= Mask{a.lane[i] < b.lane[i]} << i;
    return mask;
  }

  /// Stores the lanes of `mask` one after the other; what follows them up to kWidth is undefined.
  static void Compress(const Floats& a, Mask mask, float* to) {
    for (std::uint32_t i = 0; i < kWidth; ++i) {
      *to = a.lane[i];
      to += mask >> i & 1;
    }
  }
  static void Compress(const Uints& a, Mask mask, std::uint32_t* to) {
    for (std::uint32_t i = 0; i < kWidth; ++i) {
      *to = a.lane[i];
      to += mask >> i & 1;
    }
  }

  static std::uint32_t SumOf(const Uints& a, Mask mask) {
    std::uint32_t sum = 0;
    for (std::uint32_t i = 0; i < kWidth; ++i) sum += (mask >> i & 1) != 0 ? a.lane[i] : 0;
    return sum;
  }

 private:
  template <typename Operation>
  static Floats Each(const Floats& a, const Floats& b, const Operation& operation) {
    Floats out;
    for (std::uint32_t i = 0; i < kWidth; ++i) out.lane[i] = operation(a.lane[i], b.lane[i]);
    return out;
  }
};

}  // namespace
}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SIMD_LANES_PLAIN_H_
