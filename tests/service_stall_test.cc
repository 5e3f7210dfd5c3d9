#include <algorithm>
#include <chrono>
#include <string>
#include <thread>

#include "tests/admission_fixture.h"

// Clients that stand still lose their calls, and what those held is free.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;

using ServiceStallTest = AdmissionTest;

TEST_F(ServiceStallTest, AnUploadThatStandsStillIsCutOffAndItsSlotIsFree) {
  options_.stall = 100ms;
  options_.build_slots = 1;
  StartGated();
  OpenUpload stuck(*stub_, MakeUpload("stuck", photons_)[0]);
  EXPECT_EQ(stuck.Finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(AllGivenBack());
  EXPECT_EQ(MustBuild("healthy", photons_).version(), 1u);
  const auto lines = EndAndReadLog();
  EXPECT_TRUE(std::ranges::any_of(lines, [](const std::string& line) {
    return line.find("neither sent nor taken anything for 100 ms (--stall-seconds)") !=
           std::string::npos;
  }));
}

TEST_F(ServiceStallTest, AReaderThatStandsStillIsCutOffAndAnIdleStreamIsNot) {
  options_.stall = 200ms;
  StartGated();
  grpc::ClientContext idle_context, stuck_context;
  const auto idle = stub_->GatherStream(&idle_context);
  const auto small = MakeBatch("cloud", {0, 0, 0}, {.k = 1});
  v1::GatherResponse part;
  ASSERT_TRUE(idle->Write(small));
  ASSERT_TRUE(idle->Read(&part));

  const auto stuck = stub_->GatherStream(&stuck_context);
  ASSERT_TRUE(stuck->Write(
      MakeBatch("cloud", MakePoints(8000, 2), {.k = 1000, .outputs = kOutputNeighbors})));
  // Each stream has a message, for the batch that is on its way; the stuck one an answer too.
  const std::uint64_t idle_bytes = options_.limits.max_message_bytes;
  ASSERT_TRUE(Eventually([&] { return Info().memory_bytes_used() > 2 * idle_bytes; }));
  // Given back though nothing was read.
  EXPECT_TRUE(Eventually([&] { return Info().memory_bytes_used() == idle_bytes; }));
  EXPECT_EQ(stuck->Finish().error_code(), grpc::StatusCode::CANCELLED);

  std::this_thread::sleep_for(2 * options_.stall);
  ASSERT_TRUE(idle->Write(small));
  EXPECT_TRUE(idle->Read(&part));
  idle->WritesDone();
  EXPECT_TRUE(idle->Finish().ok());
  EXPECT_TRUE(AllGivenBack());
}

}  // namespace
}  // namespace treelight::testing
