#include "client/gather_wire.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "fmt/format.h"

namespace treelight::client {
namespace {

static_assert(std::endian::native == std::endian::little, "arrays travel as they are in memory");
static_assert(kOutputCount == v1::OUTPUT_COUNT && kOutputRadius == v1::OUTPUT_RADIUS &&
              kOutputNeighbors == v1::OUTPUT_NEIGHBORS && kOutputDensity == v1::OUTPUT_DENSITY &&
              kOutputStatistics == v1::OUTPUT_STATISTICS &&
              kOutputErrorBound == v1::OUTPUT_ERROR_BOUND);

v1::DensityKernel ToWire(DensityKernel kernel) {
  switch (kernel) {
    case DensityKernel::kConstant:
      return v1::DENSITY_KERNEL_CONSTANT;
    case DensityKernel::kCone:
      return v1::DENSITY_KERNEL_CONE;
    case DensityKernel::kEpanechnikov:
      return v1::DENSITY_KERNEL_EPANECHNIKOV;
  }
  return v1::DENSITY_KERNEL_UNSPECIFIED;
}

std::string Bytes(std::span<const float> array) {
  return {reinterpret_cast<const char*>(array.data()), array.size_bytes()};
}

absl::Status Malformed(std::string_view what) {
  return absl::InternalError(fmt::format("malformed answer from the server: {}", what));
}

// Appends the `count` numbers that `bytes` must hold.
template <typename T>
absl::Status AppendArray(std::string_view field, const std::string& bytes, std::uint64_t count,
                         std::vector<T>& array) {
  if (bytes.size() != count * sizeof(T)) {
    return Malformed(
        fmt::format("{} has {} bytes, expected {}", field, bytes.size(), count * sizeof(T)));
  }
  if (count == 0) return absl::OkStatus();
  array.resize(array.size() + count);
  std::memcpy(&*array.end() - count, bytes.data(), bytes.size());
  return absl::OkStatus();
}

template <typename T>
void AppendVector(const std::vector<T>& part, std::vector<T>& whole) {
  whole.insert(whole.end(), part.begin(), part.end());
}

// Appends the offsets of further lists; both begin with 0 where they have any.
void AppendOffsets(const std::vector<std::uint64_t>& part, std::vector<std::uint64_t>& whole) {
  if (part.empty()) return;
  if (whole.empty()) whole.push_back(0);
  const std::uint64_t base = whole.back();
  for (std::size_t i = 1; i < part.size(); ++i) whole.push_back(base + part[i]);
}

}  // namespace

absl::Status CheckLengths(const GatherQueries& queries) {
  const std::size_t m = queries.size();
  if (queries.positions.size() != 3 * m) {
    return absl::InvalidArgumentError(
        fmt::format("positions: {} numbers are no multiple of 3", queries.positions.size()));
  }
  if (!queries.normals.empty() && queries.normals.size() != 3 * m) {
    return absl::InvalidArgumentError(
        fmt::format("normals: {} numbers for {} queries", queries.normals.size(), m));
  }
  if (!queries.radii.empty() && queries.radii.size() != m) {
    return absl::InvalidArgumentError(
        fmt::format("radii: {} numbers for {} queries", queries.radii.size(), m));
  }
  return absl::OkStatus();
}

v1::GatherRequest MakeGatherRequest(const MapRef& map, std::uint64_t batch_id,
                                    const GatherQueries& queries, const GatherOptions& options) {
  v1::GatherRequest request;
  request.set_map(map.name);
  request.set_version(map.version);
  request.set_batch_id(batch_id);
  request.set_positions(Bytes(queries.positions));
  request.set_k(options.k);
  if (queries.radii.empty()) request.set_radius(options.radius);
  request.set_radii(Bytes(queries.radii));
  request.set_normals(Bytes(queries.normals));
  request.set_outputs(options.outputs);
  request.set_kernel(ToWire(options.kernel));
  if (options.approximation != Approximation{}) {
    v1::Approximation& approximation = *request.mutable_approximation();
    approximation.set_epsilon(options.approximation.epsilon);
    approximation.set_max_leaves(options.approximation.max_leaves);
    approximation.set_weight_tolerance(options.approximation.weight_tolerance);
    approximation.set_merged_photons(options.approximation.merged_photons);
    approximation.set_max_relative_error(options.approximation.max_relative_error);
  }
  return request;
}

void AppendResult(GatherResult part, GatherResult& whole) {
  AppendVector(part.counts, whole.counts);
  AppendVector(part.radii, whole.radii);
  AppendVector(part.neighbor_ids, whole.neighbor_ids);
  AppendVector(part.neighbor_squared_distances, whole.neighbor_squared_distances);
  AppendOffsets(part.neighbor_offsets, whole.neighbor_offsets);
  AppendVector(part.densities, whole.densities);
  AppendVector(part.nodes_visited, whole.nodes_visited);
  AppendVector(part.distance_tests, whole.distance_tests);
  AppendVector(part.error_bounds, whole.error_bounds);
  whole.times += part.times;
}

AnswerAssembly::AnswerAssembly(const v1::GatherRequest& request)
    : batch_id_(request.batch_id()),
      query_count_(request.positions().size() / (3 * sizeof(float))),
      k_(request.k()),
      outputs_(request.outputs()),
      answer_{.result = {},
              .map = {.name = request.map(), .version = request.version()},
              .timings = {}} {}

absl::Status AnswerAssembly::Add(const v1::GatherResponse& part) {
  if (const auto status = CheckPlace(part); !status.ok()) return status;
  answer_.map.version = part.version();
  if (const auto status = AddArrays(part); !status.ok()) return status;
  if (const auto status = AddNeighbors(part); !status.ok()) return status;
  received_count_ += part.query_count();
  answer_.errors.inexact_count += part.inexact_count();
  answer_.errors.largest_bound = std::max(answer_.errors.largest_bound, part.largest_error_bound());
  if (!complete()) return absl::OkStatus();
  answer_.merge_report = part.merge_report();
  answer_.timings = part.timings();
  answer_.result.times = {.upload_us = part.timings().upload_us(),
                          .kernel_us = part.timings().kernel_us(),
                          .download_us = part.timings().download_us()};
  return absl::OkStatus();
}

absl::Status AnswerAssembly::CheckPlace(const v1::GatherResponse& part) const {
  if (part.batch_id() != batch_id_) {
    return Malformed(fmt::format("batch_id is {}, expected {}", part.batch_id(), batch_id_));
  }
  if (part.map() != answer_.map.name) return Malformed("map is not the one that was asked for");
  if (part.version() == 0 || (answer_.map.version != 0 && part.version() != answer_.map.version)) {
    return Malformed(
        fmt::format("version is {}, expected {}", part.version(), answer_.map.version));
  }
  if (part.first_query() != received_count_) {
    return Malformed(
        fmt::format("first_query is {}, expected {}", part.first_query(), received_count_));
  }
  const std::uint64_t left = query_count_ - received_count_;
  if (part.query_count() == 0 || part.query_count() > left) {
    return Malformed(fmt::format("query_count is {}, expected 1 to {}", part.query_count(), left));
  }
  if (part.last() != (part.query_count() == left)) {
    return Malformed(fmt::format("last is {} with {} of {} queries answered", part.last(),
                                 received_count_ + part.query_count(), query_count_));
  }
  return absl::OkStatus();
}

absl::Status AnswerAssembly::AddArrays(const v1::GatherResponse& part) {
  const std::uint64_t m = part.query_count();
  const auto count = [&](std::uint32_t output, std::uint64_t per_query) {
    return (outputs_ & output) != 0 ? per_query * m : 0;
  };
  GatherResult& result = answer_.result;
  for (const absl::Status& status :
       {AppendArray("counts", part.counts(), count(kOutputCount, 1), result.counts),
        AppendArray("radii", part.radii(), count(kOutputRadius, 1), result.radii),
        AppendArray("densities", part.densities(), count(kOutputDensity, 3), result.densities),
        AppendArray("nodes_visited", part.nodes_visited(), count(kOutputStatistics, 1),
                    result.nodes_visited),
        AppendArray("distance_tests", part.distance_tests(), count(kOutputStatistics, 1),
                    result.distance_tests),
        AppendArray("error_bounds", part.error_bounds(), count(kOutputErrorBound, 1),
                    result.error_bounds)}) {
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status AnswerAssembly::AddNeighbors(const v1::GatherResponse& part) {
  const bool wanted = (outputs_ & kOutputNeighbors) != 0;
  const std::uint64_t m = part.query_count();
  std::vector<std::uint64_t> offsets;
  const auto read = AppendArray("neighbor_offsets", part.neighbor_offsets(),
                                wanted && k_ == 0 ? m + 1 : 0, offsets);
  if (!read.ok()) return read;
  if (!offsets.empty() && (offsets[0] != 0 || !std::is_sorted(offsets.begin(), offsets.end()))) {
    return Malformed("neighbor_offsets do not rise from 0");
  }
  const std::uint64_t count = !wanted ? 0 : k_ > 0 ? m * k_ : offsets.back();
  if (count > part.neighbor_ids().size()) {  // also keeps count * 4 from overflowing
    return Malformed(fmt::format("neighbor_ids has {} bytes for {} neighbours",
                                 part.neighbor_ids().size(), count));
  }
  GatherResult& result = answer_.result;
  for (const absl::Status& status :
       {AppendArray("neighbor_ids", part.neighbor_ids(), count, result.neighbor_ids),
        AppendArray("neighbor_squared_distances", part.neighbor_squared_distances(), count,
                    result.neighbor_squared_distances)}) {
    if (!status.ok()) return status;
  }
  AppendOffsets(offsets, result.neighbor_offsets);
  return absl::OkStatus();
}

}  // namespace treelight::client
