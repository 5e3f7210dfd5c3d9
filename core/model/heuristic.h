#ifndef TREELIGHT_CORE_MODEL_HEURISTIC_H_
#define TREELIGHT_CORE_MODEL_HEURISTIC_H_

#include <cstdint>

#include "core/kernels/types.h"
#include "core/model/box.h"

namespace treelight {

/// What stands for the probability that a search visits a node.
enum class Heuristic {
  kSah,  ///< surface area of the box (MacDonald and Booth 1990), as Bulavintsev and Zhdanov 2020
  kIsa,  ///< surface area of the box grown by the gather radius on every side
  kVvh,  ///< volume of the box grown by the gather radius (Wald, Guenther and Slusallek 2004)
};

/// Whether costs know that a leaf holds B photons.
enum class LeafTerm {
  kNone,      ///< top-down: cost in proportion to the photons; treelets: leaves stay as they are
  kLeafSize,  ///< top-down: cost in proportion to ceil(n / B); treelets: subtrees of at most B
              ///< photons may become one leaf
};

/// The measure of boxes by a heuristic, in float32 with a fixed order of operations, so that every
/// device gets the same bits:
///   d = ((max - min) * prescale) * scale + grow   for each axis, each operation rounded
///   sah, isa: (dx*dy + dy*dz) + dz*dx             half of the surface area
///   vvh:      (dx*dy) * dz
/// prescale and scale are powers of two that bring the root's longest edge to [0.5, 1), so that
/// measures neither overflow nor vanish; grow is 0 for sah, else twice the radius in that unit.
class Measure {
 public:
  /// @param root    box of all photons, not empty
  /// @param radius  gather radius, scene units, >= 0; read by isa and vvh. At least 2^-20 of the
  ///                root's longest edge is taken: with 0 all boxes of a line would cost the same.
  Measure(Heuristic heuristic, const Box& root, float radius);

  float operator()(const Box& box) const {
    const auto& [prescale, scale, grow, volume] = params_;
    const float dx = ((box.max.x - box.min.x) * prescale) * scale + grow;
    const float dy = ((box.max.y - box.min.y) * prescale) * scale + grow;
    const float dz = ((box.max.z - box.min.z) * prescale) * scale + grow;
    return volume != 0 ? (dx * dy) * dz : (dx * dy + dy * dz) + dz * dx;
  }

  /// For kernels.
  const MeasureParams& params() const { return params_; }

 private:
  MeasureParams params_{1, 1, 0, 0};
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_HEURISTIC_H_
