#ifndef TREELIGHT_CLIENT_GATHER_WIRE_H_
#define TREELIGHT_CLIENT_GATHER_WIRE_H_

#include <cstddef>
#include <cstdint>

#include "absl/status/status.h"
#include "client/photon_map_client.h"
#include "core/gatherer.h"
#include "treelight/v1/photon_map.pb.h"

// Batches and their answers as messages of photon_map.proto.
namespace treelight::client {

/// Checks that the arrays of `queries` belong together and can travel so. INVALID_ARGUMENT names
/// the array that does not, or the number that cannot.
absl::Status CheckQueries(const GatherQueries& queries, const WireOptions& wire);

/// Bytes of the arrays of one query in a message.
std::uint64_t RequestBytes(const GatherQueries& queries, const WireOptions& wire);

/// Bytes of the arrays of the answer to one query in a message, without uncapped lists.
std::uint64_t AnswerBytes(const GatherOptions& options, const WireOptions& wire);

/// The message of one batch that CheckQueries has found good.
v1::GatherRequest MakeGatherRequest(const MapRef& map, std::uint64_t batch_id,
                                    const GatherQueries& queries, const GatherOptions& options,
                                    const WireOptions& wire = {});

/// Adds what travelled for further queries.
void AppendWire(const WireSummary& part, WireSummary& whole);

/// Makes room for the answers to `query_count` queries in all, but for lists without a cap.
void ReserveResult(std::uint32_t outputs, std::uint64_t k, std::uint64_t query_count,
                   GatherResult& result);

/// Appends the answers to further queries, as if one call had answered all: offsets of lists go on
/// where they ended.
void AppendResult(GatherResult part, GatherResult& whole);

/// Puts the parts of the answer to one batch together, and trusts none of them.
class AnswerAssembly {
 public:
  explicit AnswerAssembly(const v1::GatherRequest& request);

  /// Adds the next part. INTERNAL: the part is not what photon_map.proto says; the message names
  /// the field. The assembly is then of no further use.
  absl::Status Add(const v1::GatherResponse& part);

  /// Whether all parts are here.
  bool complete() const { return received_count_ == query_count_; }

  /// The answer, once it is complete.
  GatherAnswer Take() { return std::move(answer_); }

 private:
  absl::Status CheckPlace(const v1::GatherResponse& part) const;
  absl::Status AddArrays(const v1::GatherResponse& part);
  absl::Status AddNeighbors(const v1::GatherResponse& part);

  std::uint64_t batch_id_, query_count_;
  std::uint32_t k_, outputs_;
  v1::FloatFormat floats_;            // that were asked for
  std::uint64_t received_count_ = 0;  // queries
  GatherAnswer answer_;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_GATHER_WIRE_H_
