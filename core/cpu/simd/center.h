#ifndef TREELIGHT_CORE_CPU_SIMD_CENTER_H_
#define TREELIGHT_CORE_CPU_SIMD_CENTER_H_

#include <cstddef>

#include "core/cpu/simd/packed_tree.h"
#include "core/model/box.h"

// Included by one file for each kind of instructions and compiled for it, so all of it has internal
// linkage: what linkers may merge must not hold instructions that another processor lacks.
namespace treelight {
namespace {

/// The query in all lanes. Distances are rounded as SquaredDistance rounds them.
template <typename L>
struct Center {
  using Floats = typename L::Floats;
  Floats q[3];

  explicit Center(const Vec3& center) : q{L::All(center.x), L::All(center.y), L::All(center.z)} {}

  static Floats SumOfSquares(Floats x, Floats y, Floats z) {
    return L::Add(L::Add(L::Multiply(x, x), L::Multiply(y, y)), L::Multiply(z, z));
  }

  /// To the boxes of the children: never above the distance to any photon of theirs.
  Floats ToBoxes(const PackedNode<L::kWidth>& node) const {
    return SumOfSquares(Outside(node, 0), Outside(node, 1), Outside(node, 2));
  }

  /// To the farthest corners of the boxes: never below the distance to any photon of theirs.
  Floats ToFarCorners(const PackedNode<L::kWidth>& node) const {
    return SumOfSquares(Across(node, 0), Across(node, 1), Across(node, 2));
  }

  /// To photons [place, place + W).
  Floats ToPhotons(const PackedView<L::kWidth>& tree, std::size_t place) const {
    return SumOfSquares(L::Subtract(q[0], L::Load(tree.x + place)),
                        L::Subtract(q[1], L::Load(tree.y + place)),
                        L::Subtract(q[2], L::Load(tree.z + place)));
  }

 private:
  Floats Outside(const PackedNode<L::kWidth>& node, int axis) const {
    return L::Max(L::Max(L::Subtract(L::Load(node.min[axis]), q[axis]),
                         L::Subtract(q[axis], L::Load(node.max[axis]))),
                  L::All(0));
  }
  Floats Across(const PackedNode<L::kWidth>& node, int axis) const {
    return L::Max(L::Subtract(q[axis], L::Load(node.min[axis])),
                  L::Subtract(L::Load(node.max[axis]), q[axis]));
  }
};

}  // namespace
}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SIMD_CENTER_H_
