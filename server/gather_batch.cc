#include "server/gather_batch.h"

#include <limits>
#include <span>
#include <string>
#include <string_view>

#include "core/model/first_beyond.h"
#include "core/model/octahedral.h"
#include "core/model/photons.h"
#include "core/model/quantize.h"
#include "core/model/wire_array.h"
#include "fmt/format.h"

namespace treelight::server {
namespace {

constexpr std::size_t kPosition = 3 * sizeof(float);
constexpr std::size_t kQuantizedPosition = 3 * sizeof(std::uint16_t);
constexpr std::size_t kQuantizedNormal = 2 * sizeof(std::int16_t);

absl::StatusOr<DensityKernel> ParseKernel(v1::DensityKernel kernel) {
  switch (kernel) {
    case v1::DENSITY_KERNEL_CONSTANT:
      return DensityKernel::kConstant;
    case v1::DENSITY_KERNEL_CONE:
      return DensityKernel::kCone;
    case v1::DENSITY_KERNEL_UNSPECIFIED:
    case v1::DENSITY_KERNEL_EPANECHNIKOV:
      return DensityKernel::kEpanechnikov;
    default:
      return absl::InvalidArgumentError(
          fmt::format("kernel is {}, no such kernel", static_cast<int>(kernel)));
  }
}

absl::StatusOr<v1::FloatFormat> ParseFloatFormat(v1::FloatFormat format) {
  switch (format) {
    case v1::FLOAT_FORMAT_UNSPECIFIED:
    case v1::FLOAT_FORMAT_FLOAT32:
      return v1::FLOAT_FORMAT_FLOAT32;
    case v1::FLOAT_FORMAT_HALF:
      return v1::FLOAT_FORMAT_HALF;
    default:
      return absl::InvalidArgumentError(
          fmt::format("answer_floats is {}, no such format", static_cast<int>(format)));
  }
}

/// `bytes` of positions: whole ones, at least one, and no more than the limit of a batch.
absl::Status CheckPositions(std::string_view field, const std::string& bytes,
                            std::size_t bytes_per_query, std::string_view numbers,
                            const Limits& limits) {
  if (bytes.size() % bytes_per_query != 0) {
    return absl::InvalidArgumentError(fmt::format("{}: {} bytes are no multiple of {}, three {}",
                                                  field, bytes.size(), bytes_per_query, numbers));
  }
  const std::size_t query_count = bytes.size() / bytes_per_query;
  if (query_count == 0) {
    return absl::InvalidArgumentError(
        fmt::format("{}: 0 queries, a batch holds at least 1", field));
  }
  if (query_count <= limits.max_queries) return absl::OkStatus();
  return absl::ResourceExhaustedError(
      fmt::format("{}: {} queries, the limit of a batch is {} (ServerLimits.max_queries); send "
                  "several batches",
                  field, query_count, limits.max_queries));
}

/// `bytes` of an array that may be absent: empty, or `bytes_per_query` for each of `query_count`.
absl::Status CheckQueryArray(std::string_view field, const std::string& bytes,
                             std::size_t bytes_per_query, std::size_t query_count) {
  if (bytes.empty() || bytes.size() == bytes_per_query * query_count) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{}: {} bytes, expected {} ({} bytes for each of {} queries) or none", field,
                  bytes.size(), bytes_per_query * query_count, bytes_per_query, query_count));
}

/// The box of quantised positions.
absl::StatusOr<Box> ParseBox(const std::string& bytes) {
  constexpr std::size_t kNumbers = 6;
  if (bytes.size() != kNumbers * sizeof(float)) {
    return absl::InvalidArgumentError(
        fmt::format("quantized.box: {} bytes, expected 24, six float32", bytes.size()));
  }
  std::vector<float> corners;
  AppendFromWire(bytes, corners);
  if (const std::size_t i = FirstBeyond(corners, kMaxCoordinate); i < kNumbers) {
    return absl::InvalidArgumentError(
        fmt::format("quantized.box[{}] is {}, it must be finite and within {:g}", i, corners[i],
                    kMaxCoordinate));
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (corners[axis] > corners[axis + 3]) {
      return absl::InvalidArgumentError(
          fmt::format("quantized.box: the smallest {} is {}, above the largest, {}", "xyz"[axis],
                      corners[axis], corners[axis + 3]));
    }
  }
  return MakeBox(&corners[0], &corners[3]);
}

absl::Status ParseQuantized(const v1::GatherRequest& request, const Limits& limits,
                            GatherBatch& batch) {
  for (const auto& [field, bytes] :
       {std::pair{"positions", &request.positions()}, std::pair{"normals", &request.normals()}}) {
    if (bytes->empty()) continue;
    return absl::InvalidArgumentError(
        fmt::format("{0}: {1} bytes beside quantized, which has the queries; leave {0} out, or "
                    "quantized",
                    field, bytes->size()));
  }
  const v1::QuantizedQueries& quantized = request.quantized();
  const auto box = ParseBox(quantized.box());
  if (!box.ok()) return box.status();
  auto status = CheckPositions("quantized.positions", quantized.positions(), kQuantizedPosition,
                               "uint16", limits);
  if (status.ok()) {
    status = CheckQueryArray("quantized.normals", quantized.normals(), kQuantizedNormal,
                             QueryCount(request));
  }
  if (!status.ok()) return status;
  std::vector<std::uint16_t> offsets;
  AppendFromWire(quantized.positions(), offsets);
  AppendPositions(*box, offsets, batch.positions);
  batch.largest_move = LargestMove(*box);
  std::vector<std::int16_t> normals;
  AppendFromWire(quantized.normals(), normals);
  for (std::size_t i = 0; i < normals.size(); i += 2) {
    const Vec3 normal = DecodeOctahedral(normals[i], normals[i + 1]);
    batch.normals.insert(batch.normals.end(), {normal.x, normal.y, normal.z});
  }
  return absl::OkStatus();
}

absl::Status ParseArrays(const v1::GatherRequest& request, const Limits& limits,
                         GatherBatch& batch) {
  absl::Status status;
  if (request.has_quantized()) {
    status = ParseQuantized(request, limits, batch);
  } else {
    status = CheckPositions("positions", request.positions(), kPosition, "float32", limits);
    if (status.ok()) {
      status = CheckQueryArray("normals", request.normals(), kPosition, QueryCount(request));
    }
    if (!status.ok()) return status;
    AppendFromWire(request.positions(), batch.positions);
    AppendFromWire(request.normals(), batch.normals);
  }
  if (status.ok()) {
    status = CheckQueryArray("radii", request.radii(), sizeof(float), QueryCount(request));
  }
  if (status.ok()) AppendFromWire(request.radii(), batch.radii);
  return status;
}

Approximation ParseApproximation(const v1::Approximation& approximation) {
  return {.epsilon = approximation.epsilon(),
          .max_leaves = approximation.max_leaves(),
          .weight_tolerance = approximation.weight_tolerance(),
          .merged_photons = approximation.merged_photons(),
          .max_relative_error = approximation.max_relative_error(),
          .thinned_photons = approximation.thinned_photons()};
}

}  // namespace

GatherQueries GatherBatch::queries(std::size_t first, std::size_t last) const {
  const auto slice = [&](const std::vector<float>& array, std::size_t width) {
    return array.empty() ? std::span<const float>()
                         : std::span(array).subspan(width * first, width * (last - first));
  };
  return {.positions = slice(positions, 3), .normals = slice(normals, 3), .radii = slice(radii, 1)};
}

std::size_t QueryCount(const v1::GatherRequest& request) {
  return request.has_quantized() ? request.quantized().positions().size() / kQuantizedPosition
                                 : request.positions().size() / kPosition;
}

std::uint64_t BatchBytes(const v1::GatherRequest& request) {
  const v1::QuantizedQueries& quantized = request.quantized();
  return request.positions().size() + request.normals().size() + request.radii().size() +
         quantized.positions().size() / kQuantizedPosition * kPosition +
         quantized.normals().size() / kQuantizedNormal * kPosition;
}

absl::StatusOr<GatherBatch> ParseGather(const v1::GatherRequest& request, const Gatherer& map,
                                        const Limits& limits) {
  GatherBatch batch;
  if (auto status = ParseArrays(request, limits, batch); !status.ok()) return status;
  const auto kernel = ParseKernel(request.kernel());
  if (!kernel.ok()) return kernel.status();
  const auto floats = ParseFloatFormat(request.answer_floats());
  if (!floats.ok()) return floats.status();
  batch.answer_floats = *floats;
  batch.options = {
      .k = request.k(),
      .radius = request.has_radius() ? request.radius() : std::numeric_limits<float>::infinity(),
      .outputs = request.outputs(),
      .kernel = *kernel,
      .approximation = ParseApproximation(request.approximation())};
  if (auto status = CheckGather(map, batch.queries(0, batch.size()), batch.options); !status.ok())
    return status;
  return batch;
}

}  // namespace treelight::server
