#ifndef TREELIGHT_CORE_MODEL_FACING_BALANCE_H_
#define TREELIGHT_CORE_MODEL_FACING_BALANCE_H_

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include "core/model/box.h"
#include "core/model/octahedral.h"

namespace treelight {

/// A photon that may give its direction to the photon that a group becomes.
struct GroupMember {
  std::uint32_t id = 0;
  double weight = 0;        ///< >= 0, in any unit that all groups share
  std::uint32_t faces = 0;  ///< FacingBalance::FacesOf its direction
};

/// Chooses a direction for each of a row of groups so that before every normal there is about as
/// much light as if each photon had kept its own: by error diffusion (Floyd and Steinberg 1976, "An
/// Adaptive Algorithm for Spatial Greyscale"), as dithering keeps the grey of a picture. What a
/// direction gets wrong, the next groups make up for, so that groups have to come in an order in
/// which neighbours are near one another.
///
/// Normals are those of a lattice on a hemisphere; what faces -n is what does not face n. With
/// e(n) = the weight that faced n and should still, the next group of weight W is given the
/// direction of its photon that makes the sum over n of e(n)^2 least:
///   e(n) = e(n) kKept + sum of its weights that face n - (W where the chosen direction faces n)
class FacingBalance {
 public:
  static constexpr std::size_t kNormals = 32;  ///< bits of GroupMember::faces

  /// What stays of an error from one group to the next: that of a bright place is not made up for
  /// far from it.
  static constexpr double kKept = 0.9375;

  FacingBalance() {
    // A Fibonacci lattice: equal steps of height and golden angles, without a library's sine.
    constexpr double kCosine = -0.7373688780783197, kSine = 0.6754902942615238;
    double x = 1, y = 0;
    for (std::size_t i = 0; i < kNormals; ++i) {
      const double z = (static_cast<double>(i) + 0.5) / kNormals, ring = std::sqrt(1 - z * z);
      normals_[i] = {static_cast<float>(ring * x), static_cast<float>(ring * y),
                     static_cast<float>(z)};
      const double turned = kCosine * x - kSine * y;
      y = kSine * x + kCosine * y;
      x = turned;
    }
  }

  /// Unit vectors, z > 0.
  const std::array<Vec3, kNormals>& normals() const { return normals_; }

  /// Bit i: the octahedral direction [2] goes against normal i, as light does that is gathered.
  std::uint32_t FacesOf(const std::int16_t* direction) const {
    const Vec3 d = DecodeOctahedral(direction[0], direction[1]);
    std::uint32_t faces = 0;
    for (std::size_t i = 0; i < kNormals; ++i) {
      const Vec3& n = normals_[i];
      faces |= std::uint32_t{d.x * n.x + d.y * n.y + d.z * n.z < 0} << i;
    }
    return faces;
  }

  /// The id of that of `group`, not empty, whose direction all of it gets; of equally good ones the
  /// smallest.
  std::uint32_t Choose(std::span<const GroupMember> group) {
    double total = 0;
    for (double& error : errors_) error *= kKept;
    for (const GroupMember& member : group) {
      total += member.weight;
      for (std::size_t i = 0; i < kNormals; ++i) errors_[i] += Bit(member, i) * member.weight;
    }
    const GroupMember* best = nullptr;
    double least = 0;
    for (const GroupMember& member : group) {
      double change = 0;  // of the sum of squares, over W
      for (std::size_t i = 0; i < kNormals; ++i) {
        change += Bit(member, i) * (total - 2 * errors_[i]);
      }
      if (best == nullptr || change < least || (change == least && member.id < best->id)) {
        best = &member;
        least = change;
      }
    }
    for (std::size_t i = 0; i < kNormals; ++i) errors_[i] -= Bit(*best, i) * total;
    return best->id;
  }

 private:
  static double Bit(const GroupMember& member, std::size_t i) { return member.faces >> i & 1; }

  std::array<Vec3, kNormals> normals_;
  std::array<double, kNormals> errors_{};
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_FACING_BALANCE_H_
