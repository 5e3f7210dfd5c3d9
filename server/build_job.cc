#include "server/build_job.h"

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/guard.h"
#include "server/host_photons.h"
#include "server/persistence.h"
#include "server/refusal.h"
#include "server/residency.h"
#include "server/room.h"
#include "server/upload.h"

namespace treelight::server {
namespace {

/// What a version of a map takes of host memory beside its photons and tree, at most, bytes: with
/// the longest name and request id.
constexpr std::uint64_t kVersionBytes = 8192;

/// Whether one version more may be kept: all together take an eighth of the memory's limit. Builds
/// that are under way do not count. RESOURCE_EXHAUSTED with Quota::kMaps; time alone does not help.
absl::Status CheckVersionCount(const State& state) {
  const std::size_t count = state.store.size();
  const std::uint64_t limit = state.memory.limit_bytes(), most = limit / 8 / kVersionBytes;
  if (count < most || Broken("map_count")) return absl::OkStatus();
  return Refuse(Quota::kMaps,
                fmt::format("the server has {} versions of maps, with a --memory-limit of {} it "
                            "takes {}; delete maps, or give them a time to live",
                            count, limit, most),
                std::nullopt);
}

}  // namespace

BuildJob::BuildJob(State& state, grpc::CallbackServerContext& context, std::string_view method,
                   v1::BuildPhotonMapResponse& response)
    : state_(state),
      response_(response),
      call_(state, context, method),
      record_(call_.NewRecord()) {
  record_.device = state.device_name();
}

void BuildJob::Identify(const std::string& request_id, const google::protobuf::Message& request) {
  if (request_id.empty()) return;
  request_id_ = request_id;
  request_ = KeepRequest(request);
}

absl::Status BuildJob::Admit(const BuildPlan& plan, std::uint64_t photon_bytes,
                             std::string_view what) {
  plan_ = plan;
  if (!plan_.request_id.empty()) record_.request_id = plan_.request_id;
  // A repeat needs no further version.
  if (request_id_.empty() || state_.store.FindRequest(request_id_) == nullptr) {
    if (auto status = CheckVersionCount(state_); !status.ok()) return status;
  }
  if (state_.snapshots != nullptr) {
    const auto room = state_.snapshots->CheckRoom(
        SnapshotBytes(plan_.photon_count, plan_.has_powers, plan_.has_directions), what);
    if (!room.ok()) return room;
  }
  if (auto status = state_.device_queue.Check(Ask()); !status.ok()) return status;
  auto slot = state_.build_slots.Take(state_.device_queue.RetryDelay());
  if (!slot.ok()) return slot.status();
  slot_ = *std::move(slot);
  const std::uint64_t map_bytes = state_.maps_in_host_memory() ? MapBytes(plan_) : 0;
  std::uint64_t work_bytes = state_.builder->WorkBytes(plan_.options, plan_.photon_count);
  if (plan_.automatic) work_bytes += state_.chooser.WorkBytes(*plan_.automatic);
  const std::uint64_t all_bytes = photon_bytes + work_bytes + map_bytes;
  auto memory = TakeHostMemory(state_, Holder::kUploads, all_bytes, what);
  if (!memory.ok()) return memory.status();
  // After the host's memory, of which maps that leave the device take some.
  if (auto status = MakeDeviceRoom(state_, plan_, what); !status.ok()) return status;
  photon_memory_ = *std::move(memory);
  map_memory_ = photon_memory_.Split(Holder::kMaps, map_bytes);
  return absl::OkStatus();
}

absl::StatusOr<bool> BuildJob::AnsweredByAnEarlierCall() {
  if (known_ == nullptr) known_ = state_.store.FindRequest(request_id_);
  if (known_ == nullptr) return false;
  record_.request_id = request_id_;
  if (auto status = CheckRepeat(*known_, request_); !status.ok()) return status;
  return true;
}

void BuildJob::GiveBack() {
  photon_memory_ = {};
  map_memory_ = {};
  slot_ = {};
}

/// Answers with the map of an earlier call, where there is one.
absl::StatusOr<bool> BuildJob::AnswerAsBefore() {
  const auto answered = AnsweredByAnEarlierCall();
  if (answered.ok() && *answered) Answer(known_);
  return answered;
}

DeviceAsk BuildJob::Ask() const {
  return {.work = Work::Build(plan_.photon_count, plan_.options.builder),
          .deadline = call_.deadline(),
          .call = &call_};
}

void BuildJob::Submit(PhotonSource photons, std::function<void(const absl::Status&)> done) {
  if (const auto answered = AnswerAsBefore(); !answered.ok() || *answered) {
    return done(answered.status());
  }
  // The queue copies its jobs, photons are moved.
  const auto source = std::make_shared<PhotonSource>(std::move(photons));
  const auto submitted = state_.device_queue.Submit(
      [this] { return call_.Alive(); },
      [this, source, done](const absl::Status& turn, double queue_us) {
        record_.timings.set_queue_us(queue_us);
        if (!turn.ok()) return done(turn);
        const Stopwatch held;
        const absl::Status status = Guard([&] { return Build(*source); });
        record_.device_us = held.microseconds();
        if (!status.ok() || known_ != nullptr) return done(status);
        Keep(done);
      },
      Ask());
  if (!submitted.ok()) done(submitted);
}

absl::Status BuildJob::Build(const PhotonSource& photons) {
  // The first call with this id may have been built while this one waited: one device, one build at
  // a time.
  if (const auto answered = AnswerAsBefore(); !answered.ok() || *answered) {
    return answered.status();
  }
  auto gatherer = BuildMap(photons);
  if (!gatherer.ok()) return call_.Explain(gatherer.status());
  if (auto status = call_.Alive(); !status.ok())
    return status;  // a call that fails changes nothing
  StoredMap map{.name = plan_.name,
                .version = 0,
                .request_id = request_id_,
                .options = plan_.options,
                .request = request_,
                .choice = std::move(choice_),
                .gatherer = *std::move(gatherer),
                .created = std::chrono::system_clock::now(),
                .expires = {},
                .memory = std::move(map_memory_)};
  if (state_.maps_in_host_memory()) map.memory.Resize(map.gatherer->report().device_bytes);
  if (plan_.time_to_live.count() > 0) map.expires = map.created + plan_.time_to_live;
  built_ = std::move(map);
  return absl::OkStatus();
}

/// Makes the map visible, where there is a data folder once it is there: on the disk's thread, for
/// the device has other work.
void BuildJob::Keep(const std::function<void(const absl::Status&)>& done) {
  if (state_.snapshots == nullptr) {
    StoredMap map = *std::exchange(built_, std::nullopt);
    MakeReloadable(state_, map, std::make_shared<HostPhotons>(state_, plan_));
    Answer(state_.store.Add(std::move(map)));
    return done(absl::OkStatus());
  }
  state_.disk.Submit([this, done] { done(Guard([this] { return Write(); })); });
}

absl::Status BuildJob::Write() {
  // The first call with this id may have been written while this one was built.
  if (const auto answered = AnswerAsBefore(); !answered.ok() || *answered) {
    return answered.status();
  }
  if (auto status = call_.Alive(); !status.ok()) return status;
  const auto kept = KeepMap(state_, *std::exchange(built_, std::nullopt), photons_);
  if (!kept.ok()) return kept.status();
  Answer(*kept);
  return absl::OkStatus();
}

/// Settles the options that are left to the server.
absl::Status BuildJob::Choose() {
  if (!plan_.automatic) return absl::OkStatus();
  const Stopwatch watch;
  auto choice = state_.chooser.Choose(photons_, *plan_.automatic, plan_.options, call_.cancelled());
  if (!choice.ok()) return choice.status();
  plan_.options = choice->options;
  choice_ = std::move(choice->reason);
  record_.choice = choice_;
  record_.stages.push_back({"choose", watch.microseconds()});
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<Gatherer>> BuildJob::BuildMap(const PhotonSource& photons) {
  const Stopwatch reading;
  auto read = photons();
  if (!read.ok()) return read.status();
  photons_ = *std::move(read);
  v1::Timings& timings = record_.timings;
  timings.set_download_us(reading.microseconds());
  if (auto status = Choose(); !status.ok()) return status;
  auto gatherer = BuildWithRoom(state_, photons_, plan_, plan_.options, call_.cancelled());
  if (!gatherer.ok()) return gatherer.status();
  const auto& stages = (*gatherer)->report().stages;
  record_.stages.insert(record_.stages.end(), stages.begin(), stages.end());
  for (const StageTime& stage : stages) {
    if (stage.stage == "upload") {
      timings.set_upload_us(timings.upload_us() + stage.microseconds);
    } else if (stage.stage == "download") {
      timings.set_download_us(timings.download_us() + stage.microseconds);
    } else {
      timings.set_kernel_us(timings.kernel_us() + stage.microseconds);
    }
  }
  return gatherer;
}

void BuildJob::Answer(const MapHandle& map) {
  const Stopwatch watch;
  *response_.mutable_map() = ToWire(*map);
  record_.map = map->name;
  record_.version = map->version;
  record_.options = response_.map().options();
  record_.tree = response_.map().statistics();
  record_.device = map->gatherer->report().device;
  record_.timings.set_serialise_us(watch.microseconds());
  record_.timings.set_total_us(watch_.microseconds());
  *response_.mutable_timings() = record_.timings;
  record_.bytes_out = response_.ByteSizeLong();
}

/// Gives back what the build has taken, before its client learns that it is over.
void BuildJob::Release(std::shared_ptr<void> rest) {
  // Freeing many photons takes too long for a thread of gRPC. The memory is given back after it.
  const std::size_t bytes = std::max(record_.bytes_in, plan_.photon_count * sizeof(Vec3));
  state_.RunOnCpu(bytes, [memory = std::move(photon_memory_), photons = std::move(photons_),
                          rest = std::move(rest)] {});
  built_.reset();
  GiveBack();
}

grpc::Status BuildJob::End(const absl::Status& status, std::shared_ptr<void> rest) {
  if (!status.ok()) record_.timings.set_total_us(watch_.microseconds());
  call_.Log(record_, status);
  Release(std::move(rest));
  return call_.End(status);
}

}  // namespace treelight::server
