#include "server/build_call.h"

#include <memory>
#include <utility>

#include "fmt/format.h"

namespace treelight::server {

BuildCall::BuildCall(State& state, grpc::CallbackServerContext& context,
                     v1::BuildPhotonMapResponse& response)
    : state_(state), job_(state, context, "BuildPhotonMap", response) {
  if (job_.call().admission().ok()) {
    job_.call().AwaitRequest([this] { StartRead(&message_); });
  } else {
    End(job_.call().admission());
  }
}

void BuildCall::Read() {
  job_.call().AwaitClient();
  StartRead(&message_);
}

void BuildCall::OnReadDone(bool ok) {
  job_.call().ClientMoved();
  if (!ok) {
    // The client has sent all it will, or has gone.
    if (auto status = job_.call().Alive(); !status.ok()) return End(status);
    return Submit();
  }
  job_.call().MessageCame();
  const std::uint64_t bytes = message_.ByteSizeLong();
  job_.record().bytes_in += bytes;
  if (upload_) job_.call().UploadBrought(bytes);
  // A repeat of a build that is done needs no photons. They are read nevertheless: a client that
  // writes would not see an early answer on every transport.
  if (!needs_photons_) return Read();
  if (!message_.has_header()) return Take();
  // Maps that leave the device to make room have their photons copied.
  state_.RunOnCpu(message_.header().photon_count(), [this] { Take(); });
}

void BuildCall::Take() {
  if (auto status = TakeMessage(); !status.ok()) return End(status);
  if (message_.has_header()) {
    job_.call().RequestCounted();                    // room for a message is part of an upload
    WithNewestMaps(state_, [this] { Continue(); });  // another server may have built the map
  } else {
    Continue();
  }
}

void BuildCall::Continue() {
  const auto answered = job_.AnsweredByAnEarlierCall();
  if (!answered.ok()) return End(answered.status());
  needs_photons_ = !*answered;
  if (!needs_photons_) {
    upload_.reset();
    job_.call().UploadEnded();
  }
  Read();
}

absl::Status BuildCall::TakeMessage() {
  switch (message_.message_case()) {
    case v1::BuildPhotonMapRequest::kHeader:
      if (upload_)
        return absl::InvalidArgumentError("header: a second one; only the first message is one");
      return TakeHeader(message_.header());
    case v1::BuildPhotonMapRequest::kChunk:
      if (!upload_)
        return absl::InvalidArgumentError("chunk: before the header, which is the first message");
      return upload_->Add(message_.chunk());
    default:
      return absl::InvalidArgumentError("message: neither header nor chunk");
  }
}

absl::Status BuildCall::TakeHeader(const v1::BuildHeader& header) {
  job_.record().map = header.name();
  job_.record().photons = header.photon_count();
  job_.record().options = header.options();
  if (auto status = job_.call().CheckRoute(header.name()); !status.ok()) return status;
  const Limits& limits = state_.options.limits;
  const auto plan = ParseBuildHeader(header, limits);
  if (!plan.ok()) return plan.status();
  job_.Identify(header.request_id(), header);
  if (auto status = job_.Admit(*plan, UploadBytes(*plan, limits),
                               fmt::format("header.photon_count is {}", plan->photon_count));
      !status.ok()) {
    return status;
  }
  auto upload = Upload::Start(*plan, limits);
  if (!upload.ok()) return upload.status();
  upload_ = *std::move(upload);
  job_.call().UploadBrought(0);
  return absl::OkStatus();
}

void BuildCall::Submit() {
  job_.call().UploadEnded();
  job_.record().timings.set_receive_us(job_.microseconds());
  if (needs_photons_ && !upload_)
    return End(absl::InvalidArgumentError("header: the stream is empty"));
  if (needs_photons_) {
    auto photons = (*std::move(upload_)).Finish();
    if (!photons.ok()) return End(photons.status());
    photons_ = *std::move(photons);
  }
  job_.Submit([this] { return std::move(photons_); },
              [this](const absl::Status& status) { End(status); });
}

void BuildCall::End(const absl::Status& status) {
  job_.call().UploadEnded();
  auto rest = std::make_shared<std::pair<std::optional<Upload>, Photons>>(std::move(upload_),
                                                                          std::move(photons_));
  Finish(job_.End(status, std::move(rest)));
}

}  // namespace treelight::server
