#ifndef TREELIGHT_SERVER_BATCH_H_
#define TREELIGHT_SERVER_BATCH_H_

#include <cstddef>
#include <functional>

#include "absl/status/status.h"
#include "core/gatherer.h"
#include "server/call.h"
#include "server/convert.h"
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
class Batch {
 public:
  /// Everything outlives the batch.
  Batch(State& state, const Call& call, AnswerForm form);

  /// Parses `request`, waits for the device and gathers. `done` is called exactly once, with
  /// nothing held and not always on another thread: OK, or the error that photon_map.proto
  /// documents, UNAVAILABLE where the call was not admitted. `request` may go once it is called.
  void Run(const v1::GatherRequest& request, std::function<void(const absl::Status&)> done);

  /// Writes the next part of the answer, the whole for AnswerForm::kMessage. RESOURCE_EXHAUSTED:
  /// see FindPartEnd.
  absl::Status WriteNext(v1::GatherResponse& response);

  bool complete() const { return next_query_ == batch_.size(); }  ///< all parts are written
  std::size_t next_bytes() const;  ///< about what the next part will take

  /// Writes the log line, with `status` as the end of the batch.
  void Log(const absl::Status& status);

 private:
  absl::Status Parse(const v1::GatherRequest& request);
  absl::Status Gather();
  void Describe(const v1::GatherRequest& request);

  State& state_;
  const Call& call_;
  const AnswerForm form_;
  const Stopwatch watch_;
  RequestRecord record_;
  MapHandle map_;
  GatherBatch batch_;
  GatherResult result_;
  std::size_t next_query_ = 0;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_BATCH_H_
