#include "tests/emulated/wide_search.h"

#include <algorithm>
#include <numeric>
#include <stdexcept>

#include "tests/emulated/work_group.h"

namespace treelight::emulated {
namespace {

constexpr std::uint64_t kUntouched = 0xdeadbeefdeadbeef;
constexpr std::size_t kPlacesBehind = 64;  // of the lists, where nothing may be written

GatherParams MakeParams(const Map& map, const GatherQueries& queries,
                        const GatherOptions& options) {
  GatherParams params{};
  params.root = map.tree.root;
  params.k = options.k;
  params.radius = options.radius;
  params.outputs = options.outputs;
  params.density_kernel = static_cast<uint>(options.kernel);
  params.has_order = 1;
  params.has_radii = queries.radii.empty() ? 0 : 1;
  params.has_normals = queries.normals.empty() ? 0 : 1;
  return params;
}

/// Writes the depths of the nodes below a child of `tree` to the boundaries at which they divide
/// the photons from `first` on.
void ListDepths(const Tree& tree, std::uint32_t link, std::uint32_t first, std::uint8_t depth,
                std::vector<std::uint8_t>& depths) {
  if ((link & kLeafBit) != 0) return;
  const Node& node = tree.nodes[link];
  const std::uint32_t middle = first + node.left_count;
  depths[middle - 1] = depth++;
  ListDepths(tree, node.left, first, depth, depths);
  ListDepths(tree, node.right, middle, depth, depths);
}

}  // namespace

Map ReadMap(const Gatherer& gatherer) {
  Map map{*gatherer.ReadTree(), {}, std::vector<PhotonPower>(gatherer.photon_count())};
  std::vector<std::uint8_t> depths(gatherer.photon_count() - 1);
  ListDepths(map.tree, map.tree.root.link, 0, 0, depths);
  map.wide = reference::MakeWideTree(map.tree, depths);
  const Photons photons = *gatherer.ReadPhotons();
  for (std::size_t i = 0; i < map.powers.size(); ++i) {
    std::copy_n(&photons.powers[3 * i], 3, map.powers[i].power);
    std::copy_n(&photons.directions[2 * i], 2, map.powers[i].direction);
  }
  return map;
}

GatherResult Search(const Program& program, const Map& map, const GatherQueries& queries,
                    const GatherOptions& options, std::uint32_t list_size) {
  const std::size_t m = queries.size();
  GatherResult result;
  if ((options.outputs & kOutputCount) != 0) result.counts.resize(m);
  if ((options.outputs & kOutputRadius) != 0) result.radii.resize(m);
  if ((options.outputs & kOutputDensity) != 0) result.densities.resize(3 * m);
  if ((options.outputs & kOutputNeighbors) != 0) {
    result.neighbor_ids.resize(m * options.k);
    result.neighbor_squared_distances.resize(m * options.k);
  }
  std::vector<std::uint32_t> order(m);
  std::iota(order.rbegin(), order.rend(), 0u);
  std::vector<std::uint64_t> lists(program.sub_groups * list_size + kPlacesBehind, kUntouched);
  const auto first_behind = lists.end() - kPlacesBehind;

  SearchArguments arguments{.boxes = map.wide.boxes.data(),
                            .wide = map.wide.shape,
                            .sizes = &map.wide.sizes,
                            .photons = map.tree.photons.data(),
                            .powers = map.powers.data(),
                            .positions = queries.positions.data(),
                            .order = order.data(),
                            .radii_in = queries.radii.data(),
                            .normals = queries.normals.data(),
                            .params = MakeParams(map, queries, options),
                            .counts = result.counts.data(),
                            .radii = result.radii.data(),
                            .neighbor_ids = result.neighbor_ids.data(),
                            .neighbor_d2 = result.neighbor_squared_distances.data(),
                            .densities = result.densities.data(),
                            .list_size = list_size,
                            .all_lists = lists.data()};
  const std::size_t group_queries = program.queries * program.sub_groups;
  const std::size_t middle = (m + 1) / 2;
  for (const auto& [first, last] : {std::pair{std::size_t{0}, middle}, std::pair{middle, m}}) {
    arguments.params.first = static_cast<uint>(first);
    arguments.params.count = static_cast<uint>(last - first);
    RunWorkGroups((last - first + group_queries - 1) / group_queries, program.sub_groups,
                  [&] { program.item(&arguments); });
  }
  if (std::any_of(first_behind, lists.end(), [](auto place) { return place != kUntouched; }))
    throw std::logic_error("a list was overrun");
  return result;
}

}  // namespace treelight::emulated
