#ifndef TREELIGHT_SERVER_BUILD_CALL_H_
#define TREELIGHT_SERVER_BUILD_CALL_H_

#include <optional>

#include "grpcpp/support/byte_buffer.h"
#include "grpcpp/support/server_callback.h"
#include "server/build_job.h"
#include "server/read_ahead.h"
#include "server/upload.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {

/// A BuildPhotonMap call: reads header and chunks, then has them built. Owns itself: made by the
/// service, gone with OnDone. Messages are read as bytes, so that the numbers of a chunk are copied
/// once; while one is taken up the next one comes.
class BuildCall final : public grpc::ServerReadReactor<grpc::ByteBuffer> {
 public:
  BuildCall(State& state, grpc::CallbackServerContext& context,
            v1::BuildPhotonMapResponse& response);

  void OnReadDone(bool ok) override;
  void OnDone() override { delete this; }

 private:
  void Read();
  void TakeUp();
  void TakeFirst();
  absl::Status TakeHeader(const v1::BuildHeader& header);
  void Continue();
  absl::Status TakeChunk();
  void Close();
  void Submit();
  void End(const absl::Status& status);

  State& state_;
  BuildJob job_;
  ReadAhead<grpc::ByteBuffer> messages_;
  // Of who takes messages up.
  bool needs_photons_ = true;     // no earlier call has built the map
  std::optional<Upload> upload_;  // from the header on, while photons are needed
  Photons photons_;               // once all are here
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_BUILD_CALL_H_
