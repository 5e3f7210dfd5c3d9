#ifndef TREELIGHT_TESTS_GATED_SERVICE_H_
#define TREELIGHT_TESTS_GATED_SERVICE_H_

#include <future>
#include <map>
#include <memory>
#include <string>

#include "nlohmann/json.hpp"
#include "tests/gated_builder.h"
#include "tests/server_fixture.h"

namespace treelight::testing {

/// A server behind a gate, so that a test can hold a call open and look at it.
class GatedServiceTest : public ServerTest {
 protected:
  /// A gather that has not been answered.
  struct PendingGather {
    grpc::ClientContext context;
    v1::GatherResponse response;
    std::future<grpc::Status> status;  // waited for before the others go
  };

  /// Starts the server, the gate open, with the map "cloud".
  void StartGated() {
    Start(std::make_unique<GatedBuilder>(gate_));
    MustBuild("cloud", photons_);
  }

  /// Gathers the photon of "cloud" next to the origin.
  grpc::Status Gather(grpc::ClientContext& context, v1::GatherResponse& response) {
    return stub_->Gather(&context, MakeBatch("cloud", {0, 0, 0}, {.k = 1}), &response);
  }

  /// Shuts the gate; returns such a gather, which stands before it.
  std::unique_ptr<PendingGather> GatherAtGate() {
    gate_->open = false;
    const int begun = gate_->gathers;
    auto call = std::make_unique<PendingGather>();
    call->status = std::async(std::launch::async, [this, pending = call.get()] {
      return Gather(pending->context, pending->response);
    });
    EXPECT_TRUE(Eventually([&] { return gate_->gathers == begun + 1; }));
    return call;
  }

  /// Deletes all versions of `name`, of which there is one.
  void Delete(const std::string& name) {
    v1::DeletePhotonMapRequest request;
    request.set_name(name);
    v1::DeletePhotonMapResponse deleted;
    grpc::ClientContext context;
    EXPECT_TRUE(stub_->DeletePhotonMap(&context, request, &deleted).ok());
    EXPECT_EQ(deleted.deleted(), 1u);
  }

  /// The last line of the log with each method; ends the server.
  std::map<std::string, nlohmann::json> LogByMethod() {
    std::map<std::string, nlohmann::json> found;
    for (const auto& line : EndAndReadLog()) {
      const auto json = nlohmann::json::parse(line);
      found[json["method"]] = json;
    }
    return found;
  }

  nlohmann::json LogOf(const std::string& method) { return LogByMethod()[method]; }

  const Photons photons_ = MakePhotons(1000, 1);
  const std::shared_ptr<Gate> gate_ = std::make_shared<Gate>();
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_GATED_SERVICE_H_
