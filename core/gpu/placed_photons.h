#ifndef TREELIGHT_CORE_GPU_PLACED_PHOTONS_H_
#define TREELIGHT_CORE_GPU_PLACED_PHOTONS_H_

#include "core/device/buffer.h"
#include "core/gpu/gpu.h"
#include "core/gpu/leaves.h"
#include "core/kernels/types.h"
#include "core/model/tree.h"

namespace treelight {

/// What a tree is but for its nodes, on the device: BuildHierarchy makes them.
struct PlacedPhotons {
  Buffer<LeafPhoton> photons;  ///< [n] in leaf order
  Leaves leaves;
  Buffer<cl_uchar> levels;  ///< [n - 1] where subtrees meet, see kLevelIndex; between leaves alone
};

/// Copies a tree of the host to the device, at least one photon.
PlacedPhotons PlaceTree(const Gpu& gpu, const Tree& tree);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_PLACED_PHOTONS_H_
