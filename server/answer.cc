#include "server/answer.h"

#include <algorithm>
#include <limits>
#include <span>
#include <vector>

#include "core/model/half.h"
#include "core/model/wire_array.h"
#include "fmt/format.h"

namespace treelight::server {
namespace {

/// Of a number that may be a half.
std::uint64_t FloatBytes(v1::FloatFormat floats) {
  return floats == v1::FLOAT_FORMAT_HALF ? sizeof(std::uint16_t) : sizeof(float);
}

std::uint64_t NeighborBytes(v1::FloatFormat floats) {
  return sizeof(std::uint32_t) + FloatBytes(floats);
}

bool Wants(const GatherOptions& options, std::uint32_t output) {
  return (options.outputs & output) != 0;
}

/// Bytes of a query's answer without its neighbours, their offset included.
std::uint64_t FixedBytes(const GatherOptions& options, v1::FloatFormat floats) {
  return (Wants(options, kOutputCount) ? 4 : 0) +
         (Wants(options, kOutputRadius) ? FloatBytes(floats) : 0) +
         (Wants(options, kOutputDensity) ? 3 * FloatBytes(floats) : 0) +
         (Wants(options, kOutputStatistics) ? 8 : 0) + (Wants(options, kOutputErrorBound) ? 4 : 0) +
         (Wants(options, kOutputNeighbors) && options.k == 0 ? 8 : 0);
}

/// The queries [first, last) of an array of `per_query` numbers each; nothing of an empty array.
template <typename T>
std::string Slice(const std::vector<T>& array, std::size_t per_query, std::size_t first,
                  std::size_t last) {
  if (array.empty()) return {};
  return WireBytes(
      std::span<const T>(array).subspan(first * per_query, (last - first) * per_query));
}

/// The queries [first, last) of an array of `per_query` numbers each, as `floats` says; the scale
/// of halves in `set_scale`.
std::string SliceOfFloats(const std::vector<float>& array, std::size_t per_query, std::size_t first,
                          std::size_t last, v1::FloatFormat floats, v1::GatherResponse& response,
                          void (v1::WireReport::*set_scale)(float)) {
  if (floats != v1::FLOAT_FORMAT_HALF || array.empty()) return Slice(array, per_query, first, last);
  const Halves halves =
      ToHalves(std::span(array).subspan(first * per_query, (last - first) * per_query));
  v1::WireReport& report = *response.mutable_wire_report();
  (report.*set_scale)(halves.scale);
  report.set_relative_error(kHalfError);
  report.set_small_count(report.small_count() + static_cast<std::uint32_t>(halves.small_count));
  response.set_approximate(true);
  return WireBytes(std::span<const std::uint16_t>(halves.numbers));
}

/// What a part that may be gathered from fewer photons tells of its errors.
void WriteMerged(const GatherResult& result, std::size_t first, std::size_t last,
                 v1::GatherResponse& response) {
  if (result.merged.empty()) return;
  const auto merged = std::span(result.merged).subspan(first, last - first);
  const auto count = static_cast<std::uint32_t>(std::ranges::count(merged, 1));
  response.set_approximate(true);
  response.set_inexact_count(count);
  if (count > 0) response.set_largest_error_bound(std::numeric_limits<float>::infinity());
}

/// What an approximate part tells of its errors.
void WriteErrors(const GatherResult& result, const GatherOptions& options, std::size_t first,
                 std::size_t last, v1::GatherResponse& response) {
  WriteMerged(result, first, last, response);
  if (!options.approximation.any()) return;
  const auto bounds = std::span(result.error_bounds).subspan(first, last - first);
  response.set_approximate(true);
  response.set_inexact_count(static_cast<std::uint32_t>(
      std::count_if(bounds.begin(), bounds.end(), [](float bound) { return bound > 0; })));
  if (!bounds.empty()) {
    response.set_largest_error_bound(*std::max_element(bounds.begin(), bounds.end()));
  }
  if (Wants(options, kOutputErrorBound)) {
    response.set_error_bounds(Slice(result.error_bounds, 1, first, last));
  }
}

}  // namespace

std::uint64_t LargestAnswer(const GatherOptions& options, v1::FloatFormat floats,
                            std::uint64_t query_count, std::uint64_t photon_count) {
  std::uint64_t bytes = FixedBytes(options, floats);
  if (Wants(options, kOutputNeighbors)) {
    bytes += NeighborBytes(floats) * (options.k > 0 ? options.k : photon_count);
  }
  return bytes * query_count + (options.k == 0 ? 8 : 0);
}

absl::Status CheckFitsMessage(const GatherOptions& options, v1::FloatFormat floats,
                              std::uint64_t query_count, std::uint64_t photon_count,
                              const Limits& limits) {
  const std::uint64_t bytes =
      LargestAnswer(options, floats, query_count, photon_count) + kEnvelopeBytes;
  if (bytes <= limits.max_message_bytes) return absl::OkStatus();
  return absl::ResourceExhaustedError(fmt::format(
      "the answer may take {} bytes ({} queries, k {}), the limit of a message is {}; use "
      "GatherStream, or fewer queries",
      bytes, query_count, options.k, limits.max_message_bytes));
}

absl::StatusOr<std::size_t> FindPartEnd(const GatherResult& result, const GatherOptions& options,
                                        v1::FloatFormat floats, std::size_t query_count,
                                        std::size_t first, const Limits& limits) {
  const bool lists = Wants(options, kOutputNeighbors) && options.k == 0;
  const std::uint64_t neighbor_bytes = NeighborBytes(floats);
  const std::uint64_t padded = Wants(options, kOutputNeighbors) ? neighbor_bytes * options.k : 0;
  std::uint64_t bytes = kEnvelopeBytes;
  std::size_t last = first;
  for (; last < query_count; ++last) {
    const std::uint64_t length =
        lists ? result.neighbor_offsets[last + 1] - result.neighbor_offsets[last] : 0;
    const std::uint64_t query_bytes =
        FixedBytes(options, floats) + padded + neighbor_bytes * length;
    if (last == first && bytes + query_bytes > limits.max_message_bytes) {
      return absl::ResourceExhaustedError(fmt::format(
          "query {} has {} neighbours, {} bytes, the limit of a message is {}; give k > 0 or "
          "a smaller radius",
          first, length, query_bytes, limits.max_message_bytes));
    }
    if (last > first && bytes + query_bytes > limits.max_part_bytes) break;
    bytes += query_bytes;
  }
  return last;
}

void WritePart(const GatherResult& result, const GatherOptions& options, v1::FloatFormat floats,
               std::size_t first, std::size_t last, v1::GatherResponse& response) {
  const auto slice = [&](const std::vector<float>& array, std::size_t per_query, std::size_t begin,
                         std::size_t end, void (v1::WireReport::*set_scale)(float)) {
    return SliceOfFloats(array, per_query, begin, end, floats, response, set_scale);
  };
  response.set_first_query(static_cast<std::uint32_t>(first));
  response.set_query_count(static_cast<std::uint32_t>(last - first));
  response.set_counts(Slice(result.counts, 1, first, last));
  response.set_radii(slice(result.radii, 1, first, last, &v1::WireReport::set_radius_scale));
  response.set_densities(
      slice(result.densities, 3, first, last, &v1::WireReport::set_density_scale));
  response.set_nodes_visited(Slice(result.nodes_visited, 1, first, last));
  response.set_distance_tests(Slice(result.distance_tests, 1, first, last));
  WriteErrors(result, options, first, last, response);
  if (!Wants(options, kOutputNeighbors)) return;
  const auto set_squared_distance_scale = &v1::WireReport::set_squared_distance_scale;
  if (options.k > 0) {
    response.set_neighbor_ids(Slice(result.neighbor_ids, options.k, first, last));
    response.set_neighbor_squared_distances(slice(result.neighbor_squared_distances, options.k,
                                                  first, last, set_squared_distance_scale));
    return;
  }
  const std::uint64_t begin = result.neighbor_offsets[first], end = result.neighbor_offsets[last];
  response.set_neighbor_ids(Slice(result.neighbor_ids, 1, begin, end));
  response.set_neighbor_squared_distances(
      slice(result.neighbor_squared_distances, 1, begin, end, set_squared_distance_scale));
  std::vector<std::uint64_t> offsets(result.neighbor_offsets.begin() + first,
                                     result.neighbor_offsets.begin() + last + 1);
  for (std::uint64_t& offset : offsets) offset -= begin;  // they restart at 0 in each part
  response.set_neighbor_offsets(WireBytes(std::span<const std::uint64_t>(offsets)));
}

}  // namespace treelight::server
