#ifndef TREELIGHT_SERVER_BATCH_H_
#define TREELIGHT_SERVER_BATCH_H_

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>

#include "absl/status/status.h"
#include "core/gatherer.h"
#include "core/merge_choice.h"
#include "server/call.h"
#include "server/gather_batch.h"
#include "server/map_store.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {

/// How the answer of a batch travels.
enum class AnswerForm {
  kMessage,  ///< whole: refused before any work where it might not fit
  kParts,    ///< by GatherStream
};

/// One batch of queries on its way to its answer: parsed, queued, gathered, written into messages,
/// logged. Not thread-safe; each step follows the one before.
///
/// A batch of a stream with k > 0 is gathered in slices, the next once the parts of the last are
/// written, so that a client that reads slowly makes the server hold one slice and not all. The
/// first is as large as a part and each further one twice as large as the one before, up to
/// Limits::max_slice_bytes and 100 ms of the device: one that does not read at all has little of
/// it, and nobody waits long for one that runs.
///
/// A slice of a few queries goes to the device with those of other batches that wait and ask the
/// same of the same map (gather_together.h).
class Batch {
 public:
  /// How a step has ended; called exactly once, with nothing held and not always on another thread.
  using Done = std::function<void(const absl::Status&)>;

  /// Everything outlives the batch.
  Batch(State& state, Call& call, AnswerForm form);

  /// Parses `request`, waits for the device and gathers the first slice. `done`: OK, or the error
  /// that photon_map.proto documents, UNAVAILABLE where the call was not admitted. `request` may go
  /// once it is called.
  void Run(const v1::GatherRequest& request, Done done);

  /// Waits for the device and gathers the next slice, once the parts of the last are written.
  void GatherNext(Done done);

  /// Writes the next part of the answer, the whole for AnswerForm::kMessage. RESOURCE_EXHAUSTED:
  /// see FindPartEnd.
  absl::Status WriteNext(v1::GatherResponse& response);

  bool slice_written() const { return next_query_ == slice_.last; }
  bool complete() const { return next_query_ == batch_.size(); }  ///< all parts are written
  std::size_t next_bytes() const;  ///< about what the next part will take

  /// Writes the log line, with `status` as the end of the batch.
  void Log(const absl::Status& status);

 private:
  struct Slice {
    std::size_t first = 0, last = 0;  // queries
  };

  absl::Status Parse(const v1::GatherRequest& request);
  absl::Status TakeMemory(Holder holder, std::uint64_t bytes, MemoryBudget::Share& share);
  absl::Status AdmitAnswer();
  void GrowSlice();
  std::uint64_t QueryBytes() const;
  std::uint64_t HeldBytes(std::size_t query_count) const;
  void GatherSlice(const Done& done);
  static void Launch(State& state);
  void GatherAlone();
  absl::Status Gather();
  void Take(GatherResult result);
  void Held(double microseconds);
  void End(const absl::Status& status);
  absl::StatusOr<GatherResult> GatherQueriesOf(const Slice& slice);
  absl::Status Choose();
  void AddTimes(const GatherTimes& times);
  void Describe(const v1::GatherRequest& request);

  State& state_;
  Call& call_;
  const AnswerForm form_;
  const Stopwatch watch_;
  RequestRecord record_;
  MapHandle map_;
  std::shared_ptr<const ResidentTree> tree_;  // of a map that had to come back: it stays
  // Before what they pay for: given back after it.
  MemoryBudget::Share message_memory_, answer_memory_;
  GatherBatch batch_;
  std::size_t slice_size_ = 0;  // queries
  Slice slice_;                 // what result_ answers
  // Of a batch that may be gathered from fewer photons, from its first slice on.
  std::optional<MergeChoice> choice_;
  Done done_;            // of the slice that waits for the device or has it
  double slice_us_ = 0;  // of the device, for slice_
  GatherResult result_;
  std::size_t next_query_ = 0;  // in no part yet
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_BATCH_H_
