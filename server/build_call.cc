#include "server/build_call.h"

#include <algorithm>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "fmt/format.h"
#include "grpcpp/impl/codegen/proto_utils.h"
#include "grpcpp/support/byte_buffer.h"

namespace treelight::server {
namespace {

/// Reads `request` from `bytes`, which are given back. INVALID_ARGUMENT: they are none, or hold
/// neither header nor chunk.
absl::Status Parse(grpc::ByteBuffer& bytes, v1::BuildPhotonMapRequest& request) {
  if (!grpc::SerializationTraits<v1::BuildPhotonMapRequest>::Deserialize(&bytes, &request).ok())
    return absl::InvalidArgumentError("message: not a BuildPhotonMapRequest");
  if (request.message_case() == v1::BuildPhotonMapRequest::MESSAGE_NOT_SET)
    return absl::InvalidArgumentError("message: neither header nor chunk");
  return absl::OkStatus();
}

}  // namespace

BuildCall::BuildCall(State& state, grpc::CallbackServerContext& context,
                     v1::BuildPhotonMapResponse& response)
    : state_(state), job_(state, context, "BuildPhotonMap", response) {
  if (job_.call().admission().ok()) {
    job_.call().AwaitRequest([this] { StartRead(&messages_.free()); });
  } else {
    End(job_.call().admission());
  }
}

void BuildCall::Read() {
  job_.call().AwaitClient();
  StartRead(&messages_.free());
}

void BuildCall::OnReadDone(bool ok) {
  job_.call().ClientMoved();
  if (ok) job_.call().MessageCame();
  if (messages_.Arrived(ok)) TakeUp();
}

/// Takes up what has arrived, until the next is still on its way. Whatever ends the call ends the
/// loop, and with it, perhaps, this object.
void BuildCall::TakeUp() {
  do {
    if (!messages_.Take()) return Close();
    const std::uint64_t bytes = messages_.taken().Length();
    job_.record().bytes_in += bytes;
    if (!needs_photons_) {
      // A repeat of a build that is done needs no photons. They are read nevertheless: a client
      // that writes would not see an early answer on every transport.
      messages_.taken().Clear();
      Read();
    } else if (!upload_) {
      return TakeFirst();
    } else {
      job_.call().UploadBrought(bytes);
      if (auto status = TakeChunk(); !status.ok()) return End(status);
    }
  } while (messages_.Next());
}

/// Takes up the first message; nothing else is read meanwhile.
void BuildCall::TakeFirst() {
  const auto request = std::make_shared<v1::BuildPhotonMapRequest>();
  if (auto status = Parse(messages_.taken(), *request); !status.ok()) return End(status);
  if (request->has_chunk()) {
    return End(absl::InvalidArgumentError("chunk: before the header, which is the first message"));
  }
  // Maps that leave the device to make room have their photons copied.
  state_.RunOnCpu(request->header().photon_count(), [this, request] {
    if (auto status = TakeHeader(request->header()); !status.ok()) return End(status);
    job_.call().RequestCounted();                    // room for messages is part of an upload
    WithNewestMaps(state_, [this] { Continue(); });  // another server may have built the map
  });
}

void BuildCall::Continue() {
  const auto answered = job_.AnsweredByAnEarlierCall();
  if (!answered.ok()) return End(answered.status());
  needs_photons_ = !*answered;
  if (!needs_photons_) {
    upload_.reset();
    job_.call().UploadEnded();
    job_.GiveBack();  // however long the client goes on
  }
  Read();
  if (messages_.Next()) TakeUp();
}

/// The client has sent all it will, or has gone.
void BuildCall::Close() {
  if (auto status = job_.call().Alive(); !status.ok()) return End(status);
  Submit();
}

/// Takes up a message behind the header. The next is read once no more than one is held.
absl::Status BuildCall::TakeChunk() {
  std::vector<grpc::Slice> slices;
  messages_.taken().Dump(&slices);
  Pieces pieces(slices.size());
  std::ranges::transform(slices, pieces.begin(), [](const grpc::Slice& slice) {
    return std::string_view(reinterpret_cast<const char*>(slice.begin()), slice.size());
  });
  auto arrays = FindArrays(pieces);
  v1::BuildPhotonMapRequest request;
  if (!arrays) {
    slices.clear();
    if (auto status = Parse(messages_.taken(), request); !status.ok()) return status;
    if (request.has_header())
      return absl::InvalidArgumentError("header: a second one; only the first message is one");
    arrays = ArraysOf(request.chunk());
  }
  Read();
  const absl::Status status = upload_->Add(*arrays);
  messages_.taken().Clear();
  return status;
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
