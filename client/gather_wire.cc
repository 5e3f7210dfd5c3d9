#include "client/gather_wire.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/huge_pages.h"
#include "core/model/first_beyond.h"
#include "core/model/half.h"
#include "core/model/octahedral.h"
#include "core/model/quantize.h"
#include "core/model/wire_array.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

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
  AppendFromWire(bytes, array);
  return absl::OkStatus();
}

// The same of numbers that may be halves times `scale`.
absl::Status AppendFloats(std::string_view field, const std::string& bytes, std::uint64_t count,
                          v1::FloatFormat floats, float scale, std::vector<float>& array) {
  if (floats != v1::FLOAT_FORMAT_HALF) return AppendArray(field, bytes, count, array);
  std::vector<std::uint16_t> halves;
  if (auto status = AppendArray(field, bytes, count, halves); !status.ok()) return status;
  // Of one that ToHalves gives no half overflows.
  if (count > 0 && !(scale > 0 && scale <= 0x1p113f)) {
    return Malformed(fmt::format("the scale of {} is {}", field, scale));
  }
  AppendFromHalves(halves, scale, array);
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

absl::Status CheckQuantizable(const GatherQueries& queries) {
  if (const std::size_t i = FirstBeyond(queries.positions, kMaxCoordinate);
      i < queries.positions.size()) {
    return absl::InvalidArgumentError(
        fmt::format("positions[{}] of query {} is {}, to be quantised it must be finite and "
                    "within {:g}",
                    i, i / 3, queries.positions[i], kMaxCoordinate));
  }
  for (std::size_t i = 0; i < queries.normals.size(); i += 3) {
    const float* const n = &queries.normals[i];
    const double length = std::hypot(double{n[0]}, double{n[1]}, double{n[2]});
    if (!(length > 0 && std::isfinite(length))) {
      return absl::InvalidArgumentError(fmt::format(
          "normals of query {} are {}, {}, {}, to be quantised they must be a direction", i / 3,
          n[0], n[1], n[2]));
    }
  }
  return absl::OkStatus();
}

v1::QuantizedQueries ToWire(const GatherQueries& queries) {
  const QuantizedPositions positions = Quantize(queries.positions);
  const Vec3 &min = positions.box.min, &max = positions.box.max;
  const std::array<float, 6> box = {min.x, min.y, min.z, max.x, max.y, max.z};
  std::vector<std::int16_t> normals;
  for (std::size_t i = 0; i < queries.normals.size(); i += 3) {
    const float* const n = &queries.normals[i];
    // Any length, where that of a float would not do.
    const double largest = std::max({std::fabs(n[0]), std::fabs(n[1]), std::fabs(n[2])});
    const auto scaled = [&](float component) { return static_cast<float>(component / largest); };
    const auto encoded = EncodeOctahedral({scaled(n[0]), scaled(n[1]), scaled(n[2])});
    normals.insert(normals.end(), encoded.begin(), encoded.end());
  }
  v1::QuantizedQueries wire;
  wire.set_box(WireBytes(std::span<const float>(box)));
  wire.set_positions(WireBytes(std::span<const std::uint16_t>(positions.offsets)));
  wire.set_normals(WireBytes(std::span<const std::int16_t>(normals)));
  return wire;
}

}  // namespace

absl::Status CheckQueries(const GatherQueries& queries, const WireOptions& wire) {
  if (auto status = CheckLengths(queries); !status.ok()) return status;
  return wire.quantize_queries ? CheckQuantizable(queries) : absl::OkStatus();
}

std::uint64_t RequestBytes(const GatherQueries& queries, const WireOptions& wire) {
  const std::uint64_t position = wire.quantize_queries ? 6 : 12,
                      normal = wire.quantize_queries ? 4 : 12;
  return position + (queries.normals.empty() ? 0 : normal) + (queries.radii.empty() ? 0 : 4);
}

std::uint64_t AnswerBytes(const GatherOptions& options, const WireOptions& wire) {
  const std::uint64_t number = wire.answer_floats == v1::FLOAT_FORMAT_HALF ? 2 : 4;
  const auto if_wanted = [&](std::uint32_t output, std::uint64_t bytes) {
    return (options.outputs & output) != 0 ? bytes : 0;
  };
  return if_wanted(kOutputCount, 4) + if_wanted(kOutputRadius, number) +
         if_wanted(kOutputNeighbors, (4 + number) * options.k) +
         if_wanted(kOutputDensity, 3 * number) + if_wanted(kOutputStatistics, 8) +
         if_wanted(kOutputErrorBound, 4);
}

v1::GatherRequest MakeGatherRequest(const MapRef& map, std::uint64_t batch_id,
                                    const GatherQueries& queries, const GatherOptions& options,
                                    const WireOptions& wire) {
  v1::GatherRequest request;
  request.set_map(map.name);
  request.set_version(map.version);
  request.set_batch_id(batch_id);
  if (wire.quantize_queries) {
    *request.mutable_quantized() = ToWire(queries);
  } else {
    request.set_positions(WireBytes(queries.positions));
    request.set_normals(WireBytes(queries.normals));
  }
  if (wire.answer_floats != v1::FLOAT_FORMAT_FLOAT32) request.set_answer_floats(wire.answer_floats);
  request.set_k(options.k);
  if (queries.radii.empty()) request.set_radius(options.radius);
  request.set_radii(WireBytes(queries.radii));
  request.set_outputs(options.outputs);
  request.set_kernel(ToWire(options.kernel));
  if (options.approximation != Approximation{}) {
    v1::Approximation& approximation = *request.mutable_approximation();
    approximation.set_epsilon(options.approximation.epsilon);
    approximation.set_max_leaves(options.approximation.max_leaves);
    approximation.set_weight_tolerance(options.approximation.weight_tolerance);
    approximation.set_merged_photons(options.approximation.merged_photons);
    approximation.set_max_relative_error(options.approximation.max_relative_error);
    approximation.set_thinned_photons(options.approximation.thinned_photons);
  }
  return request;
}

void AppendWire(const WireSummary& part, WireSummary& whole) {
  whole.request_bytes += part.request_bytes;
  whole.answer_bytes += part.answer_bytes;
  whole.largest_move = std::max(whole.largest_move, part.largest_move);
  whole.relative_error = std::max(whole.relative_error, part.relative_error);
  whole.small_count += part.small_count;
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

void ReserveResult(std::uint32_t outputs, std::uint64_t k, std::uint64_t query_count,
                   GatherResult& result) {
  const auto reserve = [&](auto& array, std::uint32_t output, std::uint64_t per_query) {
    if ((outputs & output) != 0) ReserveHuge(array, per_query * query_count);
  };
  reserve(result.counts, kOutputCount, 1);
  reserve(result.radii, kOutputRadius, 1);
  reserve(result.neighbor_ids, kOutputNeighbors, k);
  reserve(result.neighbor_squared_distances, kOutputNeighbors, k);
  reserve(result.densities, kOutputDensity, 3);
  reserve(result.nodes_visited, kOutputStatistics, 1);
  reserve(result.distance_tests, kOutputStatistics, 1);
  reserve(result.error_bounds, kOutputErrorBound, 1);
}

AnswerAssembly::AnswerAssembly(const v1::GatherRequest& request)
    : batch_id_(request.batch_id()),
      query_count_(request.has_quantized()
                       ? request.quantized().positions().size() / (3 * sizeof(std::uint16_t))
                       : request.positions().size() / (3 * sizeof(float))),
      k_(request.k()),
      outputs_(request.outputs()),
      floats_(request.answer_floats()),
      answer_{.result = {},
              .wire = {.request_bytes = request.ByteSizeLong()},
              .map = {.name = request.map(), .version = request.version()},
              .timings = {}} {
  ReserveResult(outputs_, k_, query_count_, answer_.result);
}

absl::Status AnswerAssembly::Add(const v1::GatherResponse& part) {
  if (const auto status = CheckPlace(part); !status.ok()) return status;
  answer_.map.version = part.version();
  if (const auto status = AddArrays(part); !status.ok()) return status;
  if (const auto status = AddNeighbors(part); !status.ok()) return status;
  received_count_ += part.query_count();
  answer_.errors.inexact_count += part.inexact_count();
  answer_.errors.largest_bound = std::max(answer_.errors.largest_bound, part.largest_error_bound());
  const v1::WireReport& report = part.wire_report();
  AppendWire({.request_bytes = 0,
              .answer_bytes = part.ByteSizeLong(),
              .largest_move = report.largest_move(),
              .relative_error = report.relative_error(),
              .small_count = report.small_count()},
             answer_.wire);
  if (!complete()) return absl::OkStatus();
  answer_.merge_report = part.merge_report();
  answer_.search = part.search();
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
  const v1::WireReport& report = part.wire_report();
  for (const absl::Status& status :
       {AppendArray("counts", part.counts(), count(kOutputCount, 1), result.counts),
        AppendFloats("radii", part.radii(), count(kOutputRadius, 1), floats_, report.radius_scale(),
                     result.radii),
        AppendFloats("densities", part.densities(), count(kOutputDensity, 3), floats_,
                     report.density_scale(), result.densities),
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
        AppendFloats("neighbor_squared_distances", part.neighbor_squared_distances(), count,
                     floats_, part.wire_report().squared_distance_scale(),
                     result.neighbor_squared_distances)}) {
    if (!status.ok()) return status;
  }
  AppendOffsets(offsets, result.neighbor_offsets);
  return absl::OkStatus();
}

}  // namespace treelight::client
