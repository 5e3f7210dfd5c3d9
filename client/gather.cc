#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "client/gather_stream.h"
#include "client/gather_wire.h"
#include "client/map_metadata.h"
#include "client/photon_map_client.h"
#include "client/photon_map_client_impl.h"
#include "fmt/format.h"

// PhotonMapClient::Gather: a batch of any size is cut into ranges of queries that fit one message
// each.
namespace treelight::client {
namespace {

constexpr std::uint64_t kEnvelopeBytes = 4096;  // room in a message for all that is no array
constexpr std::uint64_t kMaxQueriesPerBatch =
    1 << 16;  // so that the server computes one while it receives the next
constexpr std::size_t kMaxInFlight = 4;  // batches sent and not received

struct Range {
  std::size_t first, count;
  friend bool operator==(const Range&, const Range&) = default;
};

bool Wants(const GatherOptions& options, std::uint32_t output) {
  return (options.outputs & output) != 0;
}

GatherQueries Slice(const GatherQueries& queries, const Range& range) {
  GatherQueries slice{.positions = queries.positions.subspan(3 * range.first, 3 * range.count),
                      .normals = {},
                      .radii = {}};
  if (!queries.normals.empty())
    slice.normals = queries.normals.subspan(3 * range.first, 3 * range.count);
  if (!queries.radii.empty()) slice.radii = queries.radii.subspan(range.first, range.count);
  return slice;
}

// Queries that one batch may hold, by the size of the request and, with k > 0, of the answer.
std::uint64_t QueriesPerBatch(const GatherQueries& queries, const GatherOptions& options,
                              const WireOptions& wire, const v1::ServerLimits& limits) {
  const std::uint64_t room =
      limits.max_message_bytes() - std::min(limits.max_message_bytes(), kEnvelopeBytes);
  std::uint64_t count = std::min({kMaxQueriesPerBatch, std::uint64_t{limits.max_queries()},
                                  room / RequestBytes(queries, wire)});
  if (Wants(options, kOutputNeighbors) && options.k > 0 && limits.max_neighbors() > 0) {
    count = std::min(count, limits.max_neighbors() / options.k);
  }
  return std::max<std::uint64_t>(1, count);
}

// Whether the answer to `query_count` queries fits one message for sure, so that a unary call may
// ask for it.
bool FitsMessage(std::uint64_t query_count, const GatherOptions& options, const WireOptions& wire,
                 const v1::ServerLimits& limits) {
  if (Wants(options, kOutputNeighbors) && options.k == 0) return false;
  return query_count * AnswerBytes(options, wire) + kEnvelopeBytes <= limits.max_message_bytes();
}

std::vector<Range> Split(std::size_t query_count, std::uint64_t queries_per_batch) {
  std::vector<Range> ranges;
  for (std::size_t first = 0; first < query_count; first += queries_per_batch) {
    ranges.push_back({first, std::min<std::size_t>(queries_per_batch, query_count - first)});
  }
  return ranges;
}

// As Split, but no range has more than `max_neighbors` neighbours unless it is one query.
std::vector<Range> SplitByCounts(const std::vector<std::uint32_t>& counts,
                                 std::uint64_t queries_per_batch, std::uint64_t max_neighbors) {
  std::vector<Range> ranges;
  std::uint64_t neighbor_count = 0;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    neighbor_count += counts[i];
    if (ranges.empty() || ranges.back().count == queries_per_batch ||
        neighbor_count > max_neighbors) {
      ranges.push_back({i, 0});
      neighbor_count = counts[i];
    }
    ++ranges.back().count;
  }
  return ranges;
}

// Says from which query on an error counts, where a batch did not begin with the first.
absl::Status CountedFrom(const absl::Status& status, std::size_t first_query) {
  if (first_query == 0) return status;
  absl::Status told(status.code(), fmt::format("{} (counted from query {})",
                                               std::string(status.message()), first_query));
  status.ForEachPayload(
      [&](absl::string_view url, const absl::Cord& payload) { told.SetPayload(url, payload); });
  return told;
}

void AddTimings(const v1::Timings& part, v1::Timings& sum) {
  sum.set_receive_us(sum.receive_us() + part.receive_us());
  sum.set_queue_us(sum.queue_us() + part.queue_us());
  sum.set_upload_us(sum.upload_us() + part.upload_us());
  sum.set_kernel_us(sum.kernel_us() + part.kernel_us());
  sum.set_download_us(sum.download_us() + part.download_us());
  sum.set_serialise_us(sum.serialise_us() + part.serialise_us());
  sum.set_total_us(sum.total_us() + part.total_us());
}

void AppendAnswer(GatherAnswer part, GatherAnswer& whole) {
  AddTimings(part.timings, whole.timings);
  whole.errors.inexact_count += part.errors.inexact_count;
  whole.errors.largest_bound = std::max(whole.errors.largest_bound, part.errors.largest_bound);
  const bool is_worse = part.merge_report.measured_error() > whole.merge_report.measured_error();
  if (is_worse || whole.result.densities.empty()) whole.merge_report = part.merge_report;
  if (whole.search.empty()) whole.search = std::move(part.search);
  AppendWire(part.wire, whole.wire);
  AppendResult(std::move(part.result), whole.result);
}

// One call that sends all of `queries` as one message and gets one back.
absl::StatusOr<GatherAnswer> GatherUnary(v1::PhotonMapService::Stub& stub, const MapRef& map,
                                         const GatherQueries& queries, const GatherOptions& options,
                                         const WireOptions& wire, Deadline deadline) {
  grpc::ClientContext context;
  context.set_deadline(deadline);
  NameMap(context, map.name);
  const auto request = MakeGatherRequest(map, /*batch_id=*/0, queries, options, wire);
  v1::GatherResponse response;
  if (const auto status = stub.Gather(&context, request, &response); !status.ok())
    return ToAbslStatus(status);
  AnswerAssembly assembly(request);
  if (const auto status = assembly.Add(response); !status.ok()) return status;
  return assembly.Take();
}

// One stream on which each of `ranges` is a batch.
absl::StatusOr<GatherAnswer> GatherRanges(v1::PhotonMapService::Stub& stub, const MapRef& map,
                                          const GatherQueries& queries,
                                          const GatherOptions& options, const WireOptions& wire,
                                          const std::vector<Range>& ranges, Deadline deadline) {
  GatherStream stream(stub, map.name, deadline, /*patience=*/{});
  std::size_t sent_count = 0, received_count = 0;
  absl::Status sending;  // an error here is met by receiving what the server answered before it
  GatherAnswer whole;
  while (received_count < ranges.size()) {
    while (sending.ok() && sent_count < ranges.size() &&
           sent_count - received_count < kMaxInFlight) {
      sending = stream.Send(
          MakeGatherRequest(map, sent_count, Slice(queries, ranges[sent_count]), options, wire));
      if (sending.ok()) ++sent_count;
    }
    if (received_count == sent_count) return CountedFrom(sending, ranges[received_count].first);
    auto part = stream.Receive();
    if (!part.ok()) return CountedFrom(part.status(), ranges[received_count].first);
    if (received_count == 0) {
      whole = *std::move(part);
      if (ranges.size() > 1)
        ReserveResult(options.outputs, options.k, queries.size(), whole.result);
    } else {
      AppendAnswer(*std::move(part), whole);
    }
    ++received_count;
  }
  return whole;
}

// The answer to no queries.
GatherAnswer Nothing(const v1::PhotonMap& map, const GatherOptions& options) {
  GatherAnswer answer{
      .result = {}, .map = {.name = map.name(), .version = map.version()}, .timings = {}};
  if (Wants(options, kOutputNeighbors) && options.k == 0) answer.result.neighbor_offsets = {0};
  return answer;
}

}  // namespace

absl::StatusOr<GatherAnswer> PhotonMapClient::Gather(const MapRef& map,
                                                     const GatherQueries& queries,
                                                     const GatherOptions& options,
                                                     const WireOptions& wire) {
  if (const auto status = CheckQueries(queries, wire); !status.ok()) return status;
  const Deadline deadline = impl_->NextDeadline();
  return impl_->Repeat(deadline, [&] { return GatherOnce(map, queries, options, wire, deadline); });
}

absl::StatusOr<GatherAnswer> PhotonMapClient::GatherOnce(
    const MapRef& map, const GatherQueries& queries, const GatherOptions& options,
    const WireOptions& wire, std::chrono::system_clock::time_point deadline) {
  const auto limits = impl_->GetLimits(deadline);
  if (!limits.ok()) return limits.status();
  const std::uint64_t queries_per_batch = QueriesPerBatch(queries, options, wire, *limits);
  const auto ranges = Split(queries.size(), queries_per_batch);
  const bool unary = ranges.size() == 1 && FitsMessage(queries.size(), options, wire, *limits);

  // All batches go to one version: the newest of now.
  MapRef pinned = map;
  if (ranges.empty() || (map.version == 0 && !unary)) {
    const auto found = impl_->Describe(map, deadline);
    if (!found.ok()) return found.status();
    if (ranges.empty()) return Nothing(*found, options);
    pinned.version = found->version();
  }

  auto answer = unary
                    ? GatherUnary(*impl_->stub, map, queries, options, wire, deadline)
                    : GatherRanges(*impl_->stub, pinned, queries, options, wire, ranges, deadline);
  if (answer.ok()) return answer;
  // The newest was deleted meanwhile: another one is it now, or none.
  if (absl::IsNotFound(answer.status()) && pinned.version != map.version) {
    return GatherOnce(map, queries, options, wire, deadline);
  }
  const bool too_large = absl::IsResourceExhausted(answer.status()) && !RetryDelay(answer.status());
  if (!too_large || !Wants(options, kOutputNeighbors) || options.k != 0) return answer;

  // Uncapped lists may be more than the server keeps for one batch: count them, and cut the queries
  // by the counts.
  GatherOptions counting = options;
  counting.outputs = kOutputCount;
  const auto counts = Gather(pinned, queries, counting, wire);
  if (!counts.ok()) return counts.status();
  const auto by_counts =
      SplitByCounts(counts->result.counts, queries_per_batch, limits->max_neighbors());
  if (by_counts == ranges) return answer;
  return GatherRanges(*impl_->stub, counts->map, queries, options, wire, by_counts, deadline);
}

}  // namespace treelight::client
