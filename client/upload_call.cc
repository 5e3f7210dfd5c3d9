#include "client/upload_call.h"

#include <utility>

#include "client/map_metadata.h"
#include "client/status.h"

namespace treelight::client {

UploadCall::UploadCall(v1::PhotonMapService::Stub& stub, const std::string& map,
                       std::chrono::system_clock::time_point deadline) {
  context_.set_deadline(deadline);
  NameMap(context_, map);
  stub.async()->BuildPhotonMap(&context_, &response_, this);
  AddHold();  // writes begin outside of callbacks; given back by Finish
  StartCall();
}

bool UploadCall::Write(const v1::BuildPhotonMapRequest& request) {
  AwaitWrite();
  if (!open_) return false;
  {
    const std::lock_guard lock(mutex_);
    writing_ = true;
  }
  StartWrite(&request);  // never with the lock held: it may call back from within
  return true;
}

void UploadCall::AwaitWrite() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return !writing_; });
  open_ = written_;
}

absl::StatusOr<v1::BuildPhotonMapResponse> UploadCall::Finish() {
  AwaitWrite();
  if (open_) StartWritesDone();
  RemoveHold();
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return done_; });
  if (!status_.ok()) return ToAbslStatus(status_);
  return std::move(response_);
}

void UploadCall::OnWriteDone(bool ok) {
  const std::lock_guard lock(mutex_);
  writing_ = false;
  written_ = ok;
  changed_.notify_all();
}

void UploadCall::OnDone(const grpc::Status& status) {
  const std::lock_guard lock(mutex_);
  done_ = true;
  status_ = status;
  changed_.notify_all();
}

}  // namespace treelight::client
