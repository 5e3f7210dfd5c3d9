#ifndef TREELIGHT_SERVER_BUILD_CALL_H_
#define TREELIGHT_SERVER_BUILD_CALL_H_

#include <optional>

#include "core/model/photons.h"
#include "grpcpp/support/server_callback.h"
#include "server/call.h"
#include "server/convert.h"
#include "server/upload.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {

/// A BuildPhotonMap call: reads header and chunks, waits for the device, builds, stores. Owns
/// itself: made by the service, gone with OnDone.
class BuildCall final : public grpc::ServerReadReactor<v1::BuildPhotonMapRequest> {
 public:
  BuildCall(State& state, grpc::CallbackServerContext& context,
            v1::BuildPhotonMapResponse& response);

  void OnReadDone(bool ok) override;
  void OnDone() override { delete this; }

 private:
  absl::Status TakeMessage();
  absl::Status TakeHeader(const v1::BuildHeader& header);
  absl::Status Admit();
  DeviceAsk Ask() const;
  void Read();
  void Submit();
  absl::Status Build();
  void Answer(const MapHandle& map);
  void Release();
  void End(const absl::Status& status);

  State& state_;
  v1::BuildPhotonMapResponse& response_;
  Call call_;
  const Stopwatch watch_;
  RequestRecord record_;
  v1::BuildPhotonMapRequest message_;  // the one being read
  BuildPlan plan_;
  MapHandle known_;        // what an earlier call with the same request id has built
  BuildSlots::Slot slot_;  // from the header on
  MemoryBudget::Share upload_memory_;
  MemoryBudget::Share map_memory_;  // until the map has it
  std::optional<Upload> upload_;    // from the header on
  Photons photons_;                 // once all are here
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_BUILD_CALL_H_
