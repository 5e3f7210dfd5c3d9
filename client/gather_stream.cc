#include "client/gather_stream.h"

#include <utility>

#include "client/map_metadata.h"
#include "client/status.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

// How long a stream whose answers are all received may take to end before it is cancelled.
constexpr std::chrono::seconds kFarewell{1};

}  // namespace

GatherStream::GatherStream(v1::PhotonMapService::Stub& stub, const std::string& map,
                           std::chrono::system_clock::time_point deadline,
                           std::chrono::milliseconds patience)
    : patience_(patience) {
  context_.set_deadline(deadline);
  NameMap(context_, map);
  stub.async()->GatherStream(&context_, this);
  AddHold();  // writes begin outside of callbacks; given back once reads are over and no write is
              // under way
  StartRead(&response_);
  StartCall();
}

GatherStream::~GatherStream() {
  std::unique_lock lock(mutex_);
  if (pending_.empty() && answers_.empty() && failure_.ok()) {
    changed_.wait_for(lock, kFarewell, [&] { return !writing_ || read_all_; });
    if (!writing_ && !read_all_) {
      writing_ = true;
      lock.unlock();
      StartWritesDone();
      lock.lock();
      changed_.wait_for(lock, kFarewell, [&] { return done_; });
    }
  }
  lock.unlock();  // gRPC is never called with the lock held: it may call back from within
  context_.TryCancel();
  lock.lock();
  changed_.wait(lock, [&] { return done_; });
}

absl::Status GatherStream::Send(v1::GatherRequest request) {
  std::unique_lock lock(mutex_);
  // A stream that ended is waited for until it is done, because only then it has a status.
  const auto waited = Wait(lock, [&] { return done_ || (!writing_ && !read_all_); });
  if (!waited.ok()) return waited;
  if (done_ || !failure_.ok()) return Failure();
  pending_.emplace_back(request);
  request_ = std::move(request);
  writing_ = true;
  lock.unlock();
  StartWrite(&request_);
  return absl::OkStatus();
}

absl::StatusOr<GatherAnswer> GatherStream::Receive() {
  std::unique_lock lock(mutex_);
  if (answers_.empty() && pending_.empty()) {
    return absl::FailedPreconditionError("every batch that was sent has been received");
  }
  const auto waited = Wait(lock, [&] { return done_ || !answers_.empty(); });
  if (!waited.ok()) return waited;
  if (answers_.empty()) return Failure();
  GatherAnswer answer = std::move(answers_.front());
  answers_.pop_front();
  return answer;
}

void GatherStream::OnWriteDone(bool) {  // a failed write shows as the end of the reads
  std::unique_lock lock(mutex_);
  writing_ = false;
  const bool give_back_hold = read_all_;
  changed_.notify_all();
  lock.unlock();
  if (give_back_hold) RemoveHold();
}

void GatherStream::OnReadDone(bool ok) {
  std::unique_lock lock(mutex_);
  if (!ok) {
    read_all_ = true;
    const bool give_back_hold = !writing_;
    changed_.notify_all();
    lock.unlock();
    if (give_back_hold) RemoveHold();
    return;
  }
  if (failure_.ok()) {
    failure_ = pending_.empty()
                   ? absl::InternalError("malformed answer from the server: no batch waits for it")
                   : pending_.front().Add(response_);
    if (failure_.ok() && pending_.front().complete()) {
      answers_.push_back(pending_.front().Take());
      pending_.pop_front();
      changed_.notify_all();
    }
  }
  const bool failed = !failure_.ok();
  lock.unlock();
  if (failed) context_.TryCancel();
  StartRead(&response_);
}

void GatherStream::OnDone(const grpc::Status& status) {
  const std::lock_guard lock(mutex_);
  done_ = true;
  status_ = status;
  changed_.notify_all();
}

absl::Status GatherStream::Wait(std::unique_lock<std::mutex>& lock,
                                const std::function<bool()>& ready) {
  if (patience_ == std::chrono::milliseconds::zero()) {
    changed_.wait(lock, ready);
    return absl::OkStatus();
  }
  if (changed_.wait_for(lock, patience_, ready)) return absl::OkStatus();
  if (failure_.ok()) {
    failure_ =
        absl::DeadlineExceededError(fmt::format("no answer within {} ms", patience_.count()));
  }
  lock.unlock();
  context_.TryCancel();
  lock.lock();
  return failure_;
}

absl::Status GatherStream::Failure() const {
  if (!failure_.ok()) return failure_;
  if (!status_.ok()) return ToAbslStatus(status_);
  return absl::InternalError("the server ended the stream before it answered every batch");
}

}  // namespace treelight::client
