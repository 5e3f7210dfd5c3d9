#ifndef TREELIGHT_SERVER_GATHER_BATCH_H_
#define TREELIGHT_SERVER_GATHER_BATCH_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "core/gatherer.h"
#include "server/options.h"
#include "treelight/v1/photon_map.pb.h"

// A v1::GatherRequest as core takes it. Checked here, once, as in convert.h.
namespace treelight::server {

/// A batch of queries that owns its arrays.
struct GatherBatch {
  std::vector<float> positions;  ///< [3m]
  std::vector<float> normals;    ///< [3m] or empty
  std::vector<float> radii;      ///< [m] or empty
  GatherOptions options;
  v1::FloatFormat answer_floats = v1::FLOAT_FORMAT_FLOAT32;
  float largest_move = 0;  ///< WireReport.largest_move

  /// The queries [first, last).
  GatherQueries queries(std::size_t first, std::size_t last) const;
  std::size_t size() const { return positions.size() / 3; }
};

/// Queries of a request that may be wrong.
std::size_t QueryCount(const v1::GatherRequest& request);

/// Bytes that the arrays of `request` take as a GatherBatch.
std::uint64_t BatchBytes(const v1::GatherRequest& request);

/// Lengths and limits of a batch, and what CheckGather asks for on `map`.
absl::StatusOr<GatherBatch> ParseGather(const v1::GatherRequest& request, const Gatherer& map,
                                        const Limits& limits);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_GATHER_BATCH_H_
