#include <future>
#include <vector>

#include "tests/gated_service.h"

// Calls that are cancelled, late or too many.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;

using ServiceCancelTest = GatedServiceTest;

TEST_F(ServiceCancelTest, ACancelledGatherStopsAndTheNextRuns) {
  StartGated();
  const auto first = GatherAtGate();
  first->context.TryCancel();
  EXPECT_EQ(first->status.get().error_code(), grpc::StatusCode::CANCELLED);
  // The device is only free again if the gather was told to stop: the gate is shut still.
  const auto second = GatherAtGate();
  gate_->open = true;
  EXPECT_TRUE(second->status.get().ok());
}

TEST_F(ServiceCancelTest, APassedDeadlineStopsTheWorkAndIsLoggedAsOne) {
  StartGated();
  gate_->open = false;
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + 50ms);
  v1::GatherResponse response;
  EXPECT_EQ(Gather(context, response).error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  const auto log = LogOf("Gather");
  EXPECT_EQ(log["code"], "DEADLINE_EXCEEDED");
  // No kernel was timed; the device was held nevertheless.
  EXPECT_EQ(log["kernel_us"], 0);
  EXPECT_GT(log["device_us"].get<double>(), 0);
  EXPECT_LE(log["device_us"].get<double>(), log["total_us"].get<double>());
}

TEST_F(ServiceCancelTest, ACallCancelledInTheQueueIsNeverRun) {
  StartGated();
  const auto running = GatherAtGate();
  grpc::ClientContext late, next;
  v1::GatherResponse response;
  late.set_deadline(std::chrono::system_clock::now() + 50ms);
  EXPECT_EQ(Gather(late, response).error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  gate_->open = true;
  EXPECT_TRUE(running->status.get().ok());
  EXPECT_TRUE(Gather(next, response).ok());
  EXPECT_EQ(gate_->gathers, 2);
}

TEST_F(ServiceCancelTest, AFullQueueIsResourceExhausted) {
  options_.queue_depth = 1;
  StartGated();
  gate_->open = false;
  std::vector<std::future<grpc::Status>> calls;
  for (int i = 0; i < 6; ++i) {
    calls.push_back(std::async(std::launch::async, [&] {
      grpc::ClientContext context;
      v1::GatherResponse response;
      const auto status = Gather(context, response);
      if (!status.ok()) {
        EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
        EXPECT_NE(status.error_message().find("the limit is 1 (--queue-depth)"), std::string::npos);
        gate_->open = true;  // only a refusal lets the others go on
      }
      return status;
    }));
  }
  int refused = 0;
  for (auto& call : calls) refused += call.get().ok() ? 0 : 1;
  EXPECT_GE(refused, 1);
  EXPECT_LE(refused, 5);
}

TEST_F(ServiceCancelTest, ACancelledBuildLeavesNoMap) {
  StartGated();
  gate_->open = false;
  grpc::ClientContext context;
  v1::BuildPhotonMapResponse response;
  const auto writer = stub_->BuildPhotonMap(&context, &response);
  for (const auto& message : MakeUpload("late", photons_)) ASSERT_TRUE(writer->Write(message));
  writer->WritesDone();
  ASSERT_TRUE(Eventually([&] { return gate_->builds == 2; }));
  context.TryCancel();
  EXPECT_EQ(writer->Finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(Eventually([&] { return gate_->stopped == 1; }));
  gate_->open = true;
  EXPECT_EQ(MustBuild("late", photons_).version(), 1u);
}

}  // namespace
}  // namespace treelight::testing
