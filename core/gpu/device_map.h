#ifndef TREELIGHT_CORE_GPU_DEVICE_MAP_H_
#define TREELIGHT_CORE_GPU_DEVICE_MAP_H_

#include <cstddef>
#include <cstdint>

#include "core/device/buffer.h"
#include "core/gatherer.h"
#include "core/gpu/gpu.h"
#include "core/gpu/hierarchy.h"
#include "core/gpu/wide_tree.h"

namespace treelight {

/// A finished map on a device.
struct DeviceMap {
  Gpu gpu;
  DeviceTree tree;
  DeviceWideTree wide;
  Buffer<PhotonPower> powers;  ///< [n], in order of photon index; empty where neither was uploaded
  Buffer<MortonGrid> grid;     ///< [1] of the 30-bit codes: queries are worked on in its order
  TreeKind kind = TreeKind::kKdTree;
  std::size_t photon_count = 0;
  bool has_powers = false;
  bool has_directions = false;
  std::uint32_t max_leaf_size = 16;
  BuildReport report;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_GPU_DEVICE_MAP_H_
