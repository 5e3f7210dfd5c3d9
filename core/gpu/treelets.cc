#include "core/gpu/treelets.h"

#include <algorithm>
#include <bit>
#include <span>
#include <utility>
#include <vector>

#include "core/device/guard.h"
#include "fmt/format.h"

namespace treelight {
namespace {

// Of treelet_round.cl: work-items of a group, leaves that each brings up, treelets at once.
constexpr std::size_t kTreeletGroupSize = 32, kLeavesPerItem = 4, kTeams = 4;

/// SEARCH of treelet.cl.
int SearchNumber(TreeletMethod method) {
  switch (method) {
    case TreeletMethod::kKdTree:
      return 0;
    case TreeletMethod::kBvh:
      return 1;
    case TreeletMethod::kAgglomerative:
      return 2;
  }
  return 0;
}

/// All sets of leaves, a bit for each, by their number of leaves.
struct SubsetList {
  std::vector<cl_ushort> subsets;
  std::vector<cl_uint> ends;  ///< where the sets of 0, 1 .. `size` leaves end
};

SubsetList ListSubsets(std::uint32_t size) {
  SubsetList list;
  for (std::uint32_t leaf_count = 0; leaf_count <= size; ++leaf_count) {
    for (std::uint32_t subset = 0; subset < 1u << size; ++subset) {
      if (std::popcount(subset) == static_cast<int>(leaf_count))
        list.subsets.push_back(static_cast<cl_ushort>(subset));
    }
    list.ends.push_back(static_cast<cl_uint>(list.subsets.size()));
  }
  return list;
}

}  // namespace

PlacedPhotons RestructureTreelets(const Gpu& gpu, const DeviceTree& tree, const Leaves& leaves,
                                  Buffer<cl_uchar> levels, const TreeletCost& cost,
                                  const TreeletOptions& options, const CancelCheck& cancelled) {
  const std::size_t count = tree.photons.size();
  if (leaves.leaf_count == 1) return {tree.photons, leaves, std::move(levels)};
  const cl::Program program = gpu.device->Program(
      {"meeting.cl", "measure.cl", "treelet.cl", "treelet_search.cl", "treelet_round.cl",
       "arrange.cl"},
      fmt::format("-DTREELET_SIZE={} -DSEARCH={} -DGROUP_SIZE={} -DLEAVES_PER_ITEM={} -DTEAMS={}",
                  options.treelet_size, SearchNumber(options.method), kTreeletGroupSize,
                  kLeavesPerItem, kTeams));
  const auto leaf_count = static_cast<cl_uint>(leaves.leaf_count);
  const cl_uint node_count = leaf_count - 1;
  const Buffer<NodeCosts> costs(gpu.memory(), node_count);
  const Buffer<cl_uint> parents(gpu.memory(), node_count);
  const Buffer<cl_uint> leaf_parents(gpu.memory(), count);
  const Buffer<cl_uint> meetings(gpu.memory(), node_count);
  const Buffer<cl_uint> root_height(gpu.memory(), 1);
  meetings.Fill(gpu.queue(), 0);
  Launch(gpu, program, "link_parents", node_count, kGroupSize, tree.nodes.get(), node_count,
         tree.device_root.get(), parents.get(), leaf_parents.get(), root_height.get());
  const SubsetList list =
      ListSubsets(options.method == TreeletMethod::kAgglomerative ? 0 : options.treelet_size);
  const auto subsets =
      MakeBuffer(gpu.memory(), gpu.queue(), std::span<const cl_ushort>(list.subsets));
  TreeletParams params{.measure = cost.measure.params(),
                       .max_leaf_size = cost.max_leaf_size,
                       .merges = cost.leaf_term == LeafTerm::kLeafSize ? 1u : 0u,
                       .round = 0,
                       .leaf_count = leaf_count,
                       .subset_ends = {},
                       .keep = 1 - kTreeletGain};
  std::copy(list.ends.begin(), list.ends.end(), params.subset_ends);
  for (; params.round < options.rounds; ++params.round) {
    ThrowIfCancelled(cancelled);
    Launch(gpu, program, "restructure_treelets", (leaf_count + kLeavesPerItem - 1) / kLeavesPerItem,
           kTreeletGroupSize, leaves.firsts.get(), tree.nodes.get(), costs.get(), parents.get(),
           leaf_parents.get(), meetings.get(), root_height.get(), subsets.get(), params);
  }

  Buffer<LeafPhoton> photons(gpu.memory(), count);
  const Buffer<cl_uint> flags(gpu.memory(), count + 1);
  Launch(gpu, program, "arrange_leaves", leaf_count, kGroupSize, leaves.firsts.get(), leaf_count,
         tree.photons.get(), tree.nodes.get(), costs.get(), parents.get(), leaf_parents.get(),
         root_height.get(), photons.get(), flags.get());
  Launch(gpu, program, "arrange_levels", node_count, kGroupSize, tree.nodes.get(), node_count,
         parents.get(), levels.get());
  Leaves arranged = ListLeaves(gpu, flags, count);
  return {std::move(photons), std::move(arranged), std::move(levels)};
}

}  // namespace treelight
