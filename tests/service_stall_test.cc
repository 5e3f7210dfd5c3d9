#include <algorithm>
#include <atomic>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "grpcpp/generic/generic_stub.h"
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

TEST_F(ServiceStallTest, ASlowUploadLosesItsSlotWhereNoneIsFree) {
  options_.stall = 1000ms;
  options_.build_slots = 2;
  StartGated();
  const Photons photons = MakePhotons(100'000, 1);
  const auto messages = MakeUpload("slow", photons, /*photons_per_chunk=*/1);
  // Two that send a photon at a time, which is never standing still.
  std::atomic<bool> end = false;
  std::vector<grpc::Status> statuses(2);
  std::vector<std::thread> clients;
  for (grpc::Status& status : statuses) {
    clients.emplace_back([&] {
      grpc::ClientContext context;
      v1::BuildPhotonMapResponse response;
      const auto writer = stub_->BuildPhotonMap(&context, &response);
      for (const auto& message : messages) {
        if (end || !writer->Write(message)) break;
        std::this_thread::sleep_for(20ms);
      }
      context.TryCancel();
      status = writer->Finish();
    });
  }
  const std::uint64_t upload_bytes = 28 * photons.size() + options_.limits.max_message_bytes;
  EXPECT_TRUE(Eventually([&] { return Info().memory_bytes_used() >= 2 * upload_bytes; }));
  v1::BuildPhotonMapResponse response;
  EXPECT_TRUE(
      Eventually([&] { return Build(*stub_, MakeUpload("healthy", photons_), response).ok(); }));
  end = true;
  for (std::thread& client : clients) client.join();
  EXPECT_TRUE(AllGivenBack());
  const auto lines = EndAndReadLog();
  EXPECT_TRUE(std::ranges::any_of(lines, [](const std::string& line) {
    return line.find("the upload brought less than 1048576 bytes in 2000 ms") != std::string::npos;
  }));
}

TEST_F(ServiceStallTest, AnAnswerThatNobodyTakesIsCutOff) {
  options_.stall = 200ms;
  StartGated();
  // A stream to the client, the same on the wire: it reads nothing.
  grpc::GenericStub generic(server_->InProcessChannel());
  grpc::CompletionQueue queue;
  const auto request =
      MakeBatch("cloud", MakePoints(400, 2), {.k = 1000, .outputs = kOutputNeighbors});
  grpc::ByteBuffer bytes;
  bool own = false;
  ASSERT_TRUE(grpc::SerializationTraits<v1::GatherRequest>::Serialize(request, &bytes, &own).ok());
  grpc::ClientContext context;
  const auto call = generic.PrepareCall(&context, "/treelight.v1.PhotonMapService/Gather", &queue);
  const auto next = [&] {
    void* tag = nullptr;
    bool ok = false;
    return queue.Next(&tag, &ok) && ok;
  };
  call->StartCall(&queue);
  ASSERT_TRUE(next());
  call->WriteLast(bytes, grpc::WriteOptions(), &queue);
  ASSERT_TRUE(next());
  EXPECT_TRUE(Eventually([&] { return Info().memory_bytes_used() > 3'000'000; }));
  EXPECT_TRUE(AllGivenBack());  // though nothing was read
  grpc::Status status;
  call->Finish(&status, &queue);
  ASSERT_TRUE(next());
  EXPECT_FALSE(status.ok());
}

}  // namespace
}  // namespace treelight::testing
