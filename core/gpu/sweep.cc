#include "core/gpu/sweep.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "fmt/format.h"

namespace treelight {
namespace {

// Photons of a work-item on each axis, CHUNK of subtree.cl.
constexpr std::uint32_t kSweepChunk = 8;

}  // namespace

PlacedPhotons SweepSubtrees(const Gpu& gpu, PlacedPhotons tree, std::uint32_t subtree_size,
                            const Measure& measure, LeafTerm leaf_term,
                            std::uint32_t max_leaf_size) {
  // One program for a range of sizes: the least local memory, few compilations.
  const std::uint32_t space = std::bit_ceil(std::max(subtree_size, 64u));
  const std::uint32_t small_leaf = max_leaf_size < kManyNodesLeafSize ? 1 : kManyNodesLeafSize;
  const cl::Program program = gpu.device->Program(
      {"measure.cl", "subtree.cl", "sweep.cl"},
      fmt::format("-DSUBTREE_SIZE={} -DMAX_NODES={}", space, space / (small_leaf + 1)));
  const SweepParams params{measure.params(), max_leaf_size,
                           leaf_term == LeafTerm::kLeafSize ? max_leaf_size : 1};
  const std::size_t count = tree.photons.size();
  Buffer<LeafPhoton> photons(gpu.memory(), count);
  const Buffer<cl_uint> leaf_flags(gpu.memory(), count + 1);
  const std::size_t group_size = 3 * space / kSweepChunk;
  Launch(gpu, program, "sweep_subtrees", tree.leaves.leaf_count * group_size, group_size,
         tree.photons.get(), tree.leaves.firsts.get(), static_cast<cl_uint>(count), params,
         tree.levels.get(), photons.get(), leaf_flags.get());
  Leaves leaves = ListLeaves(gpu, leaf_flags, count);
  return {std::move(photons), std::move(leaves), std::move(tree.levels)};
}

}  // namespace treelight
