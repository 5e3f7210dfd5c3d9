#ifndef TREELIGHT_TESTS_ADMISSION_FIXTURE_H_
#define TREELIGHT_TESTS_ADMISSION_FIXTURE_H_

#include <string>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "tests/gated_service.h"
#include "tests/open_upload.h"

namespace treelight::testing {

/// What grpc-status-details-bin says.
struct Details {
  std::string quota;          ///< subject of the QuotaFailure
  std::string description;    ///< of the same
  double retry_seconds = -1;  ///< of the RetryInfo; -1: there is none
};

inline Details ReadDetails(const grpc::Status& status) {
  Details details;
  google::rpc::Status wire;
  EXPECT_TRUE(wire.ParseFromString(status.error_details()));
  EXPECT_EQ(wire.code(), status.error_code());
  EXPECT_EQ(wire.message(), status.error_message());
  for (const auto& any : wire.details()) {
    google::rpc::QuotaFailure failure;
    google::rpc::RetryInfo retry;
    if (any.UnpackTo(&failure)) {
      details.quota = failure.violations(0).subject();
      details.description = failure.violations(0).description();
    } else if (any.UnpackTo(&retry)) {
      details.retry_seconds = retry.retry_delay().seconds() + 1e-9 * retry.retry_delay().nanos();
    }
  }
  return details;
}

/// A server with little room, of which a test can tell how much is held.
class AdmissionTest : public GatedServiceTest {
 protected:
  v1::ServerInfo Info() {
    v1::ServerInfo info;
    grpc::ClientContext context;
    EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
    return info;
  }

  /// Whether nothing of the memory is held any more.
  bool AllGivenBack() {
    return Eventually([&] { return Info().memory_bytes_used() == 0; });
  }
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_ADMISSION_FIXTURE_H_
