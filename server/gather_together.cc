#include "server/gather_together.h"

#include <cstdint>

#include "fmt/format.h"

namespace treelight::server {
namespace {

/// All `batches` as one, which owns its arrays.
struct Joined {
  std::vector<float> positions, normals, radii;

  explicit Joined(std::span<const GatherQueries> batches) {
    for (const GatherQueries& batch : batches) {
      positions.insert(positions.end(), batch.positions.begin(), batch.positions.end());
      normals.insert(normals.end(), batch.normals.begin(), batch.normals.end());
      radii.insert(radii.end(), batch.radii.begin(), batch.radii.end());
    }
  }
};

/// The queries [first, first + count) of an array of `per_query` numbers each; nothing of an empty
/// one.
template <typename T>
std::vector<T> Part(const std::vector<T>& array, std::size_t per_query, std::size_t first,
                    std::size_t count) {
  if (array.empty()) return {};
  const auto begin = array.begin() + static_cast<std::ptrdiff_t>(first * per_query);
  return {begin, begin + static_cast<std::ptrdiff_t>(count * per_query)};
}

}  // namespace

std::string TogetherKey(const Gatherer& map, const GatherQueries& queries,
                        const GatherOptions& options) {
  const bool lists = options.k == 0 && (options.outputs & kOutputNeighbors) != 0;
  if (queries.size() > kFewQueries || lists || options.approximation != Approximation{}) return {};
  return fmt::format("{} {} {} {} {} {} {} {}", static_cast<const void*>(&map), options.k,
                     options.radius, options.outputs, static_cast<std::uint32_t>(options.kernel),
                     options.max_neighbors, queries.normals.empty(), queries.radii.empty());
}

absl::StatusOr<std::vector<GatherResult>> GatherTogether(const Gatherer& map,
                                                         std::span<const GatherQueries> batches,
                                                         const GatherOptions& options,
                                                         const CancelCheck& cancelled) {
  const Joined joined(batches);
  const auto all =
      map.Gather({.positions = joined.positions, .normals = joined.normals, .radii = joined.radii},
                 options, cancelled);
  if (!all.ok()) return all.status();
  std::vector<GatherResult> parts;
  std::size_t first = 0;
  for (const GatherQueries& batch : batches) {
    const auto part = [&](const auto& array, std::size_t per_query) {
      return Part(array, per_query, first, batch.size());
    };
    parts.push_back({.counts = part(all->counts, 1),
                     .radii = part(all->radii, 1),
                     .neighbor_ids = part(all->neighbor_ids, options.k),
                     .neighbor_squared_distances = part(all->neighbor_squared_distances, options.k),
                     .neighbor_offsets = {},
                     .densities = part(all->densities, 3),
                     .nodes_visited = part(all->nodes_visited, 1),
                     .distance_tests = part(all->distance_tests, 1),
                     .error_bounds = part(all->error_bounds, 1),
                     .merged = part(all->merged, 1),
                     .search = all->search,
                     .times = all->times});
    first += batch.size();
  }
  return parts;
}

}  // namespace treelight::server
