#include "tests/test_device.h"

#include <cstdlib>
#include <memory>

#include "core/gpu/devices.h"
#include "core/gpu/gpu_builder.h"
#include "core/model/morton_grid.h"
#include "tests/reference.h"

namespace treelight {
namespace {

DeviceOptions TestOptions() {
  const char* device = std::getenv("TREELIGHT_TEST_DEVICE");
  return {.device = device == nullptr ? "" : device, .cache_directory = {}};
}

}  // namespace

const Gpu& TestGpu() {
  static const Gpu gpu = OpenOpenClDevice(TestOptions());
  return gpu;
}

Builder& TestBuilder() {
  static const std::unique_ptr<Builder> builder = MakeGpuBuilder(TestGpu());
  return *builder;
}

SortedCloud SortCloud(const CloudShape& shape, std::size_t count, int code_bits) {
  SortedCloud cloud;
  cloud.positions = shape.make(count, /*seed=*/7);
  const MortonGrid grid =
      MakeMortonGrid(reference::Bounds(cloud.positions), static_cast<unsigned>(code_bits) / 3);
  const auto codes = reference::MortonCodes(cloud.positions, grid, code_bits / 3);
  cloud.ids = reference::SortedIds(codes);
  std::vector<std::uint64_t> sorted;
  for (const std::uint32_t id : cloud.ids) sorted.push_back(codes[id]);
  cloud.levels = reference::SplitLevels(sorted, code_bits);
  return cloud;
}

std::vector<LeafPhoton> InLeafOrder(const SortedCloud& cloud) {
  std::vector<LeafPhoton> photons;
  for (const std::uint32_t id : cloud.ids) {
    const float* p = &cloud.positions[3 * std::size_t{id}];
    photons.push_back({p[0] + 0.0f, p[1] + 0.0f, p[2] + 0.0f, id});
  }
  return photons;
}

}  // namespace treelight
