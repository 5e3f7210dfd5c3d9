#ifndef TREELIGHT_SERVER_ANSWER_H_
#define TREELIGHT_SERVER_ANSWER_H_

#include <cstddef>
#include <cstdint>

#include "absl/status/statusor.h"
#include "core/gatherer.h"
#include "server/options.h"
#include "treelight/v1/photon_map.pb.h"

// Answers of a batch as messages: one, or parts that together hold every query once (GatherResponse
// in the proto).
namespace treelight::server {

/// Room in a message for all that is no array: names, ids, times.
inline constexpr std::uint64_t kEnvelopeBytes = 1024;

/// Array bytes of the answer to `query_count` queries on a map of `photon_count`, at most. As
/// float32 also what a GatherResult takes.
std::uint64_t LargestAnswer(const GatherOptions& options, v1::FloatFormat floats,
                            std::uint64_t query_count, std::uint64_t photon_count);

/// Refuses a batch whose answer might not fit one message. RESOURCE_EXHAUSTED points to
/// GatherStream.
absl::Status CheckFitsMessage(const GatherOptions& options, v1::FloatFormat floats,
                              std::uint64_t query_count, std::uint64_t photon_count,
                              const Limits& limits);

/// End of the part that begins with query `first`: as many queries as fit Limits::max_part_bytes,
/// at least one. RESOURCE_EXHAUSTED: the list of the first alone does not fit a message; the
/// message names the query.
absl::StatusOr<std::size_t> FindPartEnd(const GatherResult& result, const GatherOptions& options,
                                        v1::FloatFormat floats, std::size_t query_count,
                                        std::size_t first, const Limits& limits);

/// Writes first_query, query_count and the arrays of the queries [first, last) to `response`, and
/// of halves what wire_report tells of them.
void WritePart(const GatherResult& result, const GatherOptions& options, v1::FloatFormat floats,
               std::size_t first, std::size_t last, v1::GatherResponse& response);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_ANSWER_H_
