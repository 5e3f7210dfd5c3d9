#include "client/answer_csv.h"

#include <iterator>

#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {
namespace {

struct Range {
  std::size_t first, last;
};

// Where the neighbours of query `i` are, without padding.
Range Neighbors(const GatherResult& result, std::uint32_t k, std::size_t i) {
  if (k == 0) return {result.neighbor_offsets[i], result.neighbor_offsets[i + 1]};
  Range range{i * k, i * k};
  while (range.last < (i + 1) * k && result.neighbor_ids[range.last] != kNoPhoton) ++range.last;
  return range;
}

}  // namespace

std::string AnswerCsvHeader(std::uint32_t outputs) {
  std::string header = "query";
  if (outputs & kOutputCount) header += ",count";
  if (outputs & kOutputRadius) header += ",radius";
  if (outputs & kOutputDensity) header += ",density_red,density_green,density_blue";
  if (outputs & kOutputStatistics) header += ",nodes_visited,distance_tests";
  if (outputs & kOutputErrorBound) header += ",error_bound";
  if (outputs & kOutputNeighbors) header += ",neighbor_ids,neighbor_squared_distances";
  return header + "\n";
}

std::string AnswerCsvLines(const GatherResult& result, std::uint32_t outputs, std::uint32_t k,
                           std::size_t query_count, std::size_t first_query) {
  std::string lines;
  const auto out = std::back_inserter(lines);
  for (std::size_t i = 0; i < query_count; ++i) {
    fmt::format_to(out, "{}", first_query + i);
    if (outputs & kOutputCount) fmt::format_to(out, ",{}", result.counts[i]);
    if (outputs & kOutputRadius) fmt::format_to(out, ",{}", result.radii[i]);
    if (outputs & kOutputDensity) {
      const float* density = &result.densities[3 * i];
      fmt::format_to(out, ",{},{},{}", density[0], density[1], density[2]);
    }
    if (outputs & kOutputStatistics) {
      fmt::format_to(out, ",{},{}", result.nodes_visited[i], result.distance_tests[i]);
    }
    if (outputs & kOutputErrorBound) fmt::format_to(out, ",{}", result.error_bounds[i]);
    if (outputs & kOutputNeighbors) {
      const auto [first, last] = Neighbors(result, k, i);
      const auto ids = result.neighbor_ids.begin();
      const auto squared_distances = result.neighbor_squared_distances.begin();
      fmt::format_to(out, ",{},{}", fmt::join(ids + first, ids + last, " "),
                     fmt::join(squared_distances + first, squared_distances + last, " "));
    }
    lines.push_back('\n');
  }
  return lines;
}

}  // namespace treelight::client
