#ifndef TREELIGHT_SERVER_GATHER_STREAM_H_
#define TREELIGHT_SERVER_GATHER_STREAM_H_

#include <deque>
#include <memory>
#include <mutex>

#include "grpcpp/support/server_callback.h"
#include "server/batch.h"
#include "server/call.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {

/// A GatherStream call. Owns itself: made by the service, gone with OnDone.
///
/// At most two batches are here: the one being answered and the one read ahead, which is gathered
/// while the first one's parts are written. A third is read once the first is answered, so a client
/// that sends faster than it is answered is held back by HTTP/2's flow control. One that does not
/// take its answers is cut off after ServerOptions::stall; of more than State::most_idle_streams()
/// that have no batch those end that have had none for longest, and for that long.
class GatherStream final : public grpc::ServerBidiReactor<v1::GatherRequest, v1::GatherResponse> {
 public:
  GatherStream(State& state, grpc::CallbackServerContext& context);

  void OnReadDone(bool ok) override;
  void OnWriteDone(bool ok) override;
  void OnDone() override { delete this; }

 private:
  /// A batch and how far it is.
  struct Entry {
    enum class Stage { kGathering, kReady, kFailed };

    Entry(State& state, Call& call) : batch(state, call, AnswerForm::kParts) {}

    v1::GatherRequest request;
    Batch batch;
    Stage stage = Stage::kGathering;
    absl::Status status;  // of kFailed
  };

  Batch::Done Gathered(Entry& entry);
  void WritePart(Entry& entry);
  template <typename Event>
  void Advance(Event event);
  bool Gathering() const;  // needs mutex_
  absl::Status Admit();
  void EndIdle();
  void Log(const absl::Status& status);

  State& state_;
  Call call_;
  const Stopwatch watch_;
  MemoryBudget::Share read_memory_;  // of a batch that is on its way
  v1::GatherRequest request_;        // being read
  v1::GatherResponse response_;      // being written

  std::mutex mutex_;  // never held when gRPC is called: Finish may end this object
  std::deque<std::unique_ptr<Entry>> entries_;  // guarded by mutex_; the front is answered first
  // Guarded by mutex_, all below.
  bool reading_ = false;    // a read is under way
  bool starting_ = false;   // the batch that was read is on its way to the device queue
  bool writing_ = false;    // a part is made or written
  bool read_all_ = false;   // the client sends no more
  bool any_batch_ = false;  // one was taken up
  bool idle_ = false;       // the next batch is waited for, and there is none to answer
  bool finished_ = false;   // Finish is called, or about to be
  absl::Status failure_;    // how the stream ends
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_GATHER_STREAM_H_
