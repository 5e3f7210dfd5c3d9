#ifndef TREELIGHT_SERVER_BUILD_JOB_H_
#define TREELIGHT_SERVER_BUILD_JOB_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/model/photons.h"
#include "server/call.h"
#include "server/convert.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {

/// A build from its plan to its answer: the room that it takes, its turn at the device, the map,
/// the log line. What BuildPhotonMap and RebuildPhotonMap have in common. One thread at a time.
class BuildJob {
 public:
  /// Gives the photons on the device's thread, once; they stay the job's.
  using PhotonSource = std::function<absl::StatusOr<Photons>()>;

  /// `response` and `state` outlive the job.
  BuildJob(State& state, grpc::CallbackServerContext& context, std::string_view method,
           v1::BuildPhotonMapResponse& response);

  Call& call() { return call_; }
  RequestRecord& record() { return record_; }
  const BuildPlan& plan() const { return plan_; }
  double microseconds() const { return watch_.microseconds(); }  ///< since the call opened

  /// What the call asks for, by which its repeats are known; before all that follows.
  void Identify(const std::string& request_id, const google::protobuf::Message& request);

  /// Takes what the build of `plan` will need, before any photon is here: room on the device, a
  /// slot, and host memory, `photon_bytes` of it for the photons. `what` begins the refusals,
  /// "header.photon_count is 5". RESOURCE_EXHAUSTED.
  absl::Status Admit(const BuildPlan& plan, std::uint64_t photon_bytes, std::string_view what);

  /// Whether an earlier call with this request id has built: then its map is the answer.
  /// INVALID_ARGUMENT: that call asked for something else.
  absl::StatusOr<bool> AnsweredByAnEarlierCall();

  /// Gives back what Admit has taken: an earlier call has built the map.
  void GiveBack();

  /// Waits for the device, builds, stores and answers, or answers with what an earlier call has
  /// built. Then, on any thread, `done` is called once; it must End().
  void Submit(PhotonSource photons, std::function<void(const absl::Status&)> done);

  /// Writes the log, gives back what the job holds, on another thread where that takes long, and
  /// tells how the call ends. `rest` is what the call holds of photons, and goes with them.
  grpc::Status End(const absl::Status& status, std::shared_ptr<void> rest = {});

 private:
  DeviceAsk Ask() const;
  absl::Status Build(const PhotonSource& photons);
  absl::Status Choose();
  absl::StatusOr<std::unique_ptr<Gatherer>> BuildMap(const PhotonSource& photons);
  void Keep(const std::function<void(const absl::Status&)>& done);
  absl::Status Write();
  void Answer(const MapHandle& map);
  absl::StatusOr<bool> AnswerAsBefore();
  void Release(std::shared_ptr<void> rest);

  State& state_;
  v1::BuildPhotonMapResponse& response_;
  Call call_;
  const Stopwatch watch_;
  RequestRecord record_;
  std::string request_id_;  // or empty, as is the request then
  BuildRequest request_;
  BuildPlan plan_;
  std::string choice_;     // why the options were chosen, where they were
  MapHandle known_;        // what an earlier call with the same request id has built
  BuildSlots::Slot slot_;  // from Admit on
  MemoryBudget::Share photon_memory_;
  MemoryBudget::Share map_memory_;  // until the map has it
  std::optional<StoredMap> built_;  // until it is kept
  Photons photons_;                 // while they are built from, and until Release
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_BUILD_JOB_H_
