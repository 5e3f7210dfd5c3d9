#include "server/gather_stream.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "fmt/format.h"
#include "server/guard.h"
#include "server/refusal.h"
#include "server/room.h"

namespace treelight::server {
namespace {

/// Batches that may be here: the one being answered, and one read ahead.
constexpr std::size_t kBatchesHeld = 2;

}  // namespace

GatherStream::GatherStream(State& state, grpc::CallbackServerContext& context)
    : state_(state), call_(state, context, "GatherStream") {
  Advance([this] { failure_ = Admit(); });
}

/// Takes what a batch may have before it is whole. For as long as the stream is open: gRPC does not
/// tell when one begins to arrive.
absl::Status GatherStream::Admit() {
  if (!call_.admission().ok()) return call_.admission();
  const std::uint64_t bytes = state_.options.limits.max_message_bytes;
  auto taken = TakeForCall(state_, Holder::kMessages, bytes, "stream: a batch that is on its way");
  if (!taken.ok()) return taken.status();
  read_memory_ = *std::move(taken);
  return absl::OkStatus();
}

/// The client has sent nothing for long, while too many wait like this one.
void GatherStream::EndIdle() {
  Advance([this] {
    if (!idle_ || !failure_.ok()) return;  // it has moved since
    failure_ = Refuse(
        Quota::kMemory,
        fmt::format("stream: no batch for {} ms (--stall-seconds), longest of more than {} streams "
                    "that wait for one and hold {} bytes each; open it again when there is one",
                    state_.stalls.patience().count(), state_.most_idle_streams(),
                    read_memory_.bytes()),
        state_.device_queue.RetryDelay());
  });
}

void GatherStream::OnReadDone(bool ok) {
  if (!ok) {
    return Advance([this] {
      reading_ = false;
      read_all_ = true;
      if (failure_.ok())
        failure_ = call_.Alive();  // a client that has gone looks like one that has sent all
    });
  }
  call_.MessageCame();
  auto added = std::make_unique<Entry>(state_, call_);
  Entry& entry = *added;
  entry.request.Swap(&request_);
  bool failed = false;
  Advance([&] {
    failed = !failure_.ok();
    reading_ = starting_ = !failed;
    if (failed) return;
    any_batch_ = true;
    entries_.push_back(std::move(added));
  });
  if (failed) return;
  entry.batch.Run(entry.request, Gathered(entry));
  Advance([this] { reading_ = starting_ = false; });
}

/// What follows when a slice of `entry` has been gathered, or not.
Batch::Done GatherStream::Gathered(Entry& entry) {
  return [this, &entry](const absl::Status& status) {
    Advance([&] {
      entry.stage = status.ok() ? Entry::Stage::kReady : Entry::Stage::kFailed;
      entry.status = status;
    });
  };
}

void GatherStream::OnWriteDone(bool ok) {
  call_.ClientMoved();
  std::unique_ptr<Entry> answered;  // freed without the lock
  Entry* gather = nullptr;          // stays while it gathers
  Advance([&] {
    writing_ = false;
    if (!ok && failure_.ok()) {
      failure_ = call_.Alive();
      if (failure_.ok()) failure_ = absl::CancelledError("the client takes no more answers");
    }
    if (!ok) return;
    Entry& front = *entries_.front();
    if (front.batch.complete()) {
      front.batch.Log(absl::OkStatus());
      answered = std::move(entries_.front());
      entries_.pop_front();
    } else if (front.batch.slice_written() && failure_.ok()) {
      front.stage = Entry::Stage::kGathering;
      gather = &front;
    }
  });
  if (gather != nullptr) gather->batch.GatherNext(Gathered(*gather));
}

/// Makes the next part of `entry`'s answer and sends it.
void GatherStream::WritePart(Entry& entry) {
  response_.Clear();
  const auto status = Guard([&] { return entry.batch.WriteNext(response_); });
  if (!status.ok()) {
    return Advance([&] {
      writing_ = false;
      entry.stage = Entry::Stage::kFailed;
      entry.status = status;
    });
  }
  call_.AwaitClient();
  StartWrite(&response_);
}

/// Whether a batch is on its way to or on the device.
bool GatherStream::Gathering() const {
  return starting_ || std::ranges::any_of(entries_, [](const auto& entry) {
           return entry->stage == Entry::Stage::kGathering;
         });
}

/// Writes the line of a stream that has no batch to tell of.
void GatherStream::Log(const absl::Status& status) {
  RequestRecord record = call_.NewRecord();
  record.device = state_.device_name();
  record.timings.set_total_us(watch_.microseconds());
  call_.Log(record, status);
}

/// Takes note of what happened and does what has become possible: read, write a part, or finish.
/// The decision is one step under the lock; what follows it keeps this object alive, as Finish is
/// only called when nothing else goes on.
template <typename Event>
void GatherStream::Advance(Event event) {
  Entry* write = nullptr;
  bool read = false, was_idle = false;
  std::optional<absl::Status> finish;
  {
    const std::lock_guard lock(mutex_);
    event();
    if (finished_) return;  // what came too late for it
    Entry* const front = entries_.empty() ? nullptr : entries_.front().get();
    if (front != nullptr && failure_.ok() && front->stage == Entry::Stage::kFailed) {
      failure_ = front->status;
    }
    if (!failure_.ok()) {
      // Stop the work for the other batch, and wait for it.
      call_.Abandon();
      if (!finished_ && !writing_ && !Gathering()) finish = failure_;
    } else if (front == nullptr && read_all_) {
      finish = absl::OkStatus();
    } else {
      if (front != nullptr && front->stage == Entry::Stage::kReady && !writing_) write = front;
      read = !read_all_ && !reading_ && entries_.size() < kBatchesHeld;
    }
    if (write != nullptr) writing_ = true;
    if (read) reading_ = true;
    was_idle = std::exchange(idle_, reading_ && !starting_ && entries_.empty() && failure_.ok());
    if (idle_ && !was_idle) state_.idle_streams.Wait(this, [this] { EndIdle(); });
    was_idle = was_idle && !idle_;
    if (finish) {
      finished_ = true;
      for (const auto& entry : entries_) {
        entry->batch.Log(entry->status.ok() ? *finish : entry->status);
      }
      // No batch's line tells of this end.
      if (entries_.empty() && (!any_batch_ || !finish->ok())) Log(*finish);
    }
  }
  if (was_idle) state_.idle_streams.Arrived(this);
  if (read) StartRead(&request_);
  if (write != nullptr) {
    state_.RunOnCpu(write->batch.next_bytes(), [this, write] { WritePart(*write); });
  }
  if (finish) Finish(call_.End(*finish));
}

}  // namespace treelight::server
