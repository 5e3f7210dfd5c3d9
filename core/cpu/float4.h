#ifndef TREELIGHT_CORE_CPU_FLOAT4_H_
#define TREELIGHT_CORE_CPU_FLOAT4_H_

#include <cstdint>
#include <cstring>
#include <limits>

#include "core/model/heuristic.h"

namespace treelight {

/// Four floats that one instruction works on, on every processor; each lane rounds as a float does.
using Float4 = float __attribute__((vector_size(16)));

/// x, y, z of a photon, and 0: its index read as a float could be a slow one.
inline Float4 PositionOf(const LeafPhoton& photon) {
  using Bits = std::uint32_t __attribute__((vector_size(16)));
  Bits bits;
  std::memcpy(&bits, &photon, sizeof(bits));
  return reinterpret_cast<Float4>(bits & Bits{~0u, ~0u, ~0u, 0u});
}

/// A box that grows; Box with its three axes at once.
struct Box4 {
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Float4 min = {kInfinity, kInfinity, kInfinity, 0};
  Float4 max = {-kInfinity, -kInfinity, -kInfinity, 0};

  void Extend(Float4 p) {
    min = p < min ? p : min;
    max = p > max ? p : max;
  }
};

/// Measure with its three axes at once: the same bits.
class Measure4 {
 public:
  explicit Measure4(const Measure& measure) : params_(measure.params()) {}

  float operator()(const Box4& box) const {
    const auto& [prescale, scale, grow, volume] = params_;
    const Float4 d = ((box.max - box.min) * prescale) * scale + grow;
    if (volume != 0) return (d[0] * d[1]) * d[2];
    const Float4 sides = d * Float4{d[1], d[2], d[0], 0};
    return (sides[0] + sides[1]) + sides[2];
  }

 private:
  const MeasureParams params_;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_FLOAT4_H_
