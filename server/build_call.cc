#include "server/build_call.h"

#include <string>
#include <utility>

#include "fmt/format.h"
#include "server/guard.h"

namespace treelight::server {

BuildCall::BuildCall(State& state, grpc::CallbackServerContext& context,
                     v1::BuildPhotonMapResponse& response)
    : state_(state),
      response_(response),
      call_(state, context, "BuildPhotonMap"),
      record_(call_.NewRecord()) {
  record_.device = state.device_name();
  if (call_.admission().ok()) {
    Read();
  } else {
    End(call_.admission());
  }
}

void BuildCall::Read() {
  call_.AwaitClient();
  StartRead(&message_);
}

void BuildCall::OnReadDone(bool ok) {
  call_.ClientMoved();
  if (!ok) {
    // The client has sent all it will, or has gone.
    if (auto status = call_.Alive(); !status.ok()) return End(status);
    return Submit();
  }
  record_.bytes_in += message_.ByteSizeLong();
  // A repeat of a build that is done needs no photons. They are read nevertheless: a client that
  // writes would not see an early answer on every transport.
  if (known_ == nullptr) {
    if (auto status = TakeMessage(); !status.ok()) return End(status);
    known_ = state_.store.FindRequest(plan_.request_id);
    if (known_ != nullptr) upload_.reset();
  }
  Read();
}

/// Gives back what the build has taken, before its client learns that it is over.
void BuildCall::Release() {
  // Freeing a large upload takes too long for a thread of gRPC. The memory is given back after it.
  const std::size_t bytes = record_.bytes_in;
  state_.RunOnCpu(bytes, [memory = std::move(upload_memory_), photons = std::move(photons_),
                          upload = std::move(upload_)] {});
  map_memory_ = {};
  slot_ = {};
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
  record_.map = header.name();
  record_.photons = header.photon_count();
  const auto plan = ParseBuildHeader(header, state_.options.limits);
  if (!plan.ok()) return plan.status();
  plan_ = *plan;
  if (!plan_.request_id.empty()) record_.request_id = plan_.request_id;
  if (!state_.options.devices.empty()) {
    const auto room = CheckDeviceRoom(plan_, state_.options.devices[state_.options.device_index],
                                      DeviceBytes(state_.store.List()));
    if (!room.ok()) return room;
  }
  if (auto status = Admit(); !status.ok()) return status;
  auto upload = Upload::Start(plan_, state_.options.limits);
  if (!upload.ok()) return upload.status();
  upload_ = *std::move(upload);
  return absl::OkStatus();
}

/// Takes what the build will need, before any photon is here.
absl::Status BuildCall::Admit() {
  if (auto status = state_.device_queue.Check(Ask()); !status.ok()) return status;
  const auto retry_delay = state_.device_queue.RetryDelay();
  auto slot = state_.build_slots.Take(retry_delay);
  if (!slot.ok()) return slot.status();
  slot_ = *std::move(slot);
  const std::string what = fmt::format("header.photon_count is {}", plan_.photon_count);
  const std::uint64_t map_bytes = state_.maps_in_host_memory() ? MapBytes(plan_) : 0;
  auto memory = state_.memory.Take(
      Holder::kUploads, UploadBytes(plan_, state_.options.limits) + map_bytes, what, retry_delay);
  if (!memory.ok()) return memory.status();
  upload_memory_ = *std::move(memory);
  map_memory_ = upload_memory_.Split(Holder::kMaps, map_bytes);
  return absl::OkStatus();
}

DeviceAsk BuildCall::Ask() const {
  return {.work = Work::Build(plan_.photon_count), .deadline = call_.deadline()};
}

void BuildCall::Submit() {
  record_.timings.set_receive_us(watch_.microseconds());
  if (known_ != nullptr) {
    Answer(known_);
    return End(absl::OkStatus());
  }
  if (!upload_) return End(absl::InvalidArgumentError("header: the stream is empty"));
  auto photons = std::move(*upload_).Finish();
  if (!photons.ok()) return End(photons.status());
  photons_ = *std::move(photons);
  const auto submitted =
      state_.device_queue.Submit([this] { return call_.Alive(); },
                                 [this](const absl::Status& turn, double queue_us) {
                                   record_.timings.set_queue_us(queue_us);
                                   if (!turn.ok()) return End(turn);
                                   const Stopwatch held;
                                   const absl::Status status = Guard([this] { return Build(); });
                                   record_.device_us = held.microseconds();
                                   End(status);
                                 },
                                 Ask());
  if (!submitted.ok()) End(submitted);
}

absl::Status BuildCall::Build() {
  // The first call with this id may have been built while this one waited: one device, one build at
  // a time.
  if (const MapHandle known = state_.store.FindRequest(plan_.request_id)) {
    Answer(known);
    return absl::OkStatus();
  }
  auto gatherer = state_.builder->Build(photons_, plan_.options, call_.cancelled());
  if (!gatherer.ok()) return call_.Explain(gatherer.status());
  if (auto status = call_.Alive(); !status.ok())
    return status;  // a call that fails changes nothing
  StoredMap map{.name = plan_.name,
                .version = 0,
                .request_id = plan_.request_id,
                .options = plan_.options,
                .gatherer = *std::move(gatherer),
                .created = std::chrono::system_clock::now(),
                .expires = {},
                .memory = std::move(map_memory_)};
  if (state_.maps_in_host_memory()) map.memory.Resize(map.gatherer->report().device_bytes);
  if (plan_.time_to_live.count() > 0) map.expires = map.created + plan_.time_to_live;
  for (const StageTime& stage : map.gatherer->report().stages) {
    v1::Timings& timings = record_.timings;
    if (stage.stage == "upload") {
      timings.set_upload_us(timings.upload_us() + stage.microseconds);
    } else if (stage.stage == "download") {
      timings.set_download_us(timings.download_us() + stage.microseconds);
    } else {
      timings.set_kernel_us(timings.kernel_us() + stage.microseconds);
    }
  }
  record_.stages = map.gatherer->report().stages;
  Answer(state_.store.Add(std::move(map)));
  return absl::OkStatus();
}

void BuildCall::Answer(const MapHandle& map) {
  const Stopwatch watch;
  *response_.mutable_map() = ToWire(*map);
  record_.map = map->name;
  record_.version = map->version;
  record_.device = map->gatherer->report().device;
  record_.timings.set_serialise_us(watch.microseconds());
  record_.timings.set_total_us(watch_.microseconds());
  *response_.mutable_timings() = record_.timings;
  record_.bytes_out = response_.ByteSizeLong();
}

void BuildCall::End(const absl::Status& status) {
  if (!status.ok()) record_.timings.set_total_us(watch_.microseconds());
  call_.Log(record_, status);
  Release();
  Finish(call_.End(status));
}

}  // namespace treelight::server
