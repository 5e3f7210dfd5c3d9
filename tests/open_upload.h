#ifndef TREELIGHT_TESTS_OPEN_UPLOAD_H_
#define TREELIGHT_TESTS_OPEN_UPLOAD_H_

#include <memory>
#include <span>

#include "grpcpp/client_context.h"
#include "gtest/gtest.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::testing {

/// A BuildPhotonMap call that has sent its header and stands still.
class OpenUpload {
 public:
  /// The server has taken up the call when this is here.
  OpenUpload(v1::PhotonMapService::Stub& stub, const v1::BuildPhotonMapRequest& header)
      : writer_(stub.BuildPhotonMap(&context_, &response_)) {
    EXPECT_TRUE(writer_->Write(header));
    v1::ServerInfo info;
    grpc::ClientContext later;  // of the same connection
    EXPECT_TRUE(stub.GetServerInfo(&later, {}, &info).ok());
  }

  void Cancel() { context_.TryCancel(); }

  /// Sends nothing more; how the call ends by itself.
  grpc::Status Finish() { return writer_->Finish(); }

  /// Sends `rest`; how the call ends.
  grpc::Status Finish(std::span<const v1::BuildPhotonMapRequest> rest) {
    for (const auto& message : rest) {
      if (!writer_->Write(message)) break;
    }
    writer_->WritesDone();
    return writer_->Finish();
  }

 private:
  grpc::ClientContext context_;
  v1::BuildPhotonMapResponse response_;
  const std::unique_ptr<grpc::ClientWriter<v1::BuildPhotonMapRequest>> writer_;
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_OPEN_UPLOAD_H_
