#include <chrono>
#include <future>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "tests/admission_fixture.h"

// What a server without room refuses, and that it has room again afterwards.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

class ServiceAdmissionTest : public AdmissionTest {
 protected:
  /// A gather that takes so long, from which the server learns.
  void GatherFor(std::chrono::milliseconds time) {
    const auto slow = GatherAtGate();
    std::this_thread::sleep_for(time);  // that it takes
    gate_->open = true;
    ASSERT_TRUE(slow->status.get().ok());
  }
};

TEST_F(ServiceAdmissionTest, AnUploadOverTheMemoryLimitIsRefusedBeforeItsChunksAreRead) {
  options_.memory_limit = 16 << 20;
  StartGated();
  auto upload = MakeUpload("large", photons_);
  upload[0].mutable_header()->set_photon_count(1'000'000);  // 28 MB
  OpenUpload build(*stub_, upload[0]);
  // No chunk is sent: the answer does not wait for one.
  const auto status = build.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(
      status.error_message(),
      "header.photon_count is 1000000: 36388608 bytes of the server's memory, the limit is "
      "16777216 (--memory-limit), of which 0 are held (uploads 0, messages 0, answers 0, maps "
      "0); ask for less");
  const Details details = ReadDetails(status);
  EXPECT_EQ(details.quota, "memory");
  EXPECT_EQ(details.description, status.error_message());
  EXPECT_EQ(details.retry_seconds, -1);  // no repeat helps
  EXPECT_TRUE(AllGivenBack());
}

TEST_F(ServiceAdmissionTest, AnUploadThatFitsLaterIsToldWhen) {
  options_.memory_limit = 44 << 20;
  StartGated();
  auto upload = MakeUpload("first", photons_);
  upload[0].mutable_header()->set_photon_count(1'000'000);
  OpenUpload first(*stub_, upload[0]);
  ASSERT_TRUE(Eventually([&] { return Info().memory_bytes_used() == 36'388'608; }));
  OpenUpload second(*stub_, upload[0]);
  const auto status = second.Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  const Details details = ReadDetails(status);
  EXPECT_EQ(details.quota, "memory");
  EXPECT_GE(details.retry_seconds, 0.1);
  EXPECT_LE(details.retry_seconds, 30);

  first.Cancel();
  EXPECT_FALSE(first.Finish().ok());
  EXPECT_TRUE(AllGivenBack());
  EXPECT_EQ(MustBuild("second", photons_).version(), 1u);
}

TEST_F(ServiceAdmissionTest, MapsOfACpuCountAndAreGivenBackWhenTheyGo) {
  options_.devices = {MakeCpu()};
  options_.memory_limit = 90 << 20;
  StartGated();
  // What the map says that it holds, no more of what was foreseen.
  EXPECT_TRUE(Eventually([&] { return Info().memory_bytes_used() == Info().device_bytes_used(); }));
  auto upload = MakeUpload("huge", photons_);
  upload[0].mutable_header()->set_photon_count(1'000'000);  // 36 MB and a map of 72 MB
  const auto status = OpenUpload(*stub_, upload[0]).Finish();
  EXPECT_EQ(ReadDetails(status).quota, "memory");
  // Each of both would fit, together they never do: that is what the client has to know.
  EXPECT_EQ(ReadDetails(status).retry_seconds, -1);
  EXPECT_EQ(status.error_message().find("header.photon_count is 1000000: 108388608 bytes"), 0u)
      << status.error_message();
  Delete("cloud");
  EXPECT_TRUE(AllGivenBack());
}

TEST_F(ServiceAdmissionTest, AVersionMoreThanItKeepsIsRefusedUntilOneGoes) {
  options_.memory_limit = 16 << 20;
  constexpr std::uint64_t kMost = 256;  // an eighth of the limit, 8 KiB each
  StartGated();
  const Photons photon = MakePhotons(1, 1);
  for (std::uint64_t i = 1; i < kMost - 1; ++i) ASSERT_EQ(MustBuild("many", photon).version(), i);
  auto last = MakeUpload("many", photon);
  last[0].mutable_header()->set_request_id("last");
  v1::BuildPhotonMapResponse built;
  ASSERT_TRUE(Build(*stub_, last, built).ok());
  ASSERT_EQ(built.map().version(), kMost - 1);
  // No chunk is sent: the answer does not wait for one.
  const auto status = OpenUpload(*stub_, MakeUpload("many", photon)[0]).Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(status.error_message(),
            "the server has 256 versions of maps, with a --memory-limit of 16777216 it takes 256; "
            "delete maps, or give them a time to live");
  EXPECT_EQ(ReadDetails(status).quota, "maps");
  EXPECT_EQ(ReadDetails(status).retry_seconds, -1);  // time does not help
  // A repeat needs no version.
  v1::BuildPhotonMapResponse repeated;
  EXPECT_TRUE(Build(*stub_, last, repeated).ok());
  EXPECT_EQ(repeated.map().version(), kMost - 1);
  v1::RebuildPhotonMapRequest rebuild;
  rebuild.set_name("cloud");
  rebuild.set_new_name("cloud2");
  grpc::ClientContext context;
  v1::BuildPhotonMapResponse response;
  EXPECT_EQ(ReadDetails(stub_->RebuildPhotonMap(&context, rebuild, &response)).quota, "maps");
  EXPECT_EQ(Info().map_count(), kMost);
  Delete("cloud");
  EXPECT_EQ(MustBuild("many", photon).version(), kMost);
}

TEST_F(ServiceAdmissionTest, BuildsOverTheirSlotsAreRefusedAndOneGoesOnAfterwards) {
  options_.build_slots = 1;
  StartGated();
  const auto upload = MakeUpload("cloud2", photons_);
  OpenUpload first(*stub_, upload[0]);
  ASSERT_TRUE(Eventually([&] { return Info().memory_bytes_used() > 0; }));
  const auto status = OpenUpload(*stub_, upload[0]).Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(status.error_message(),
            "builds: 1 are open already, the limit is 1 (--build-slots); repeat later");
  EXPECT_EQ(ReadDetails(status).quota, "builds");
  EXPECT_GE(ReadDetails(status).retry_seconds, 0.1);
  EXPECT_TRUE(first.Finish(std::span(upload).subspan(1)).ok());
  ASSERT_TRUE(AllGivenBack());
  EXPECT_EQ(MustBuild("cloud2", photons_).version(), 2u);
}

TEST_F(ServiceAdmissionTest, AQueueThatCannotMeetTheDeadlineRefusesAtOnce) {
  StartGated();
  // A gather that is known to take 200 ms, and one of its kind that holds the device.
  GatherFor(200ms);
  const auto running = GatherAtGate();
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + 150ms);
  v1::GatherResponse response;
  const auto begun = std::chrono::steady_clock::now();
  const auto status = Gather(context, response);
  EXPECT_LT(std::chrono::steady_clock::now() - begun, 100ms);  // not at the deadline
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << status.error_message();
  EXPECT_EQ(ReadDetails(status).quota, "deadline");
  EXPECT_GE(ReadDetails(status).retry_seconds, 0.1);
  EXPECT_EQ(gate_->gathers, 2);

  // One that has the time waits.
  grpc::ClientContext patient;
  patient.set_deadline(std::chrono::system_clock::now() + 10s);
  auto waiting = std::async(std::launch::async, [&] { return Gather(patient, response); });
  gate_->open = true;
  EXPECT_TRUE(waiting.get().ok());
  EXPECT_TRUE(running->status.get().ok());
}

TEST_F(ServiceAdmissionTest, AnIdleDeviceRefusesNobodyForHisDeadline) {
  StartGated();
  GatherFor(300ms);
  // By the estimate it would be late; only trying shows that it is fast again.
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + 200ms);
  v1::GatherResponse response;
  const auto status = Gather(context, response);
  EXPECT_TRUE(status.ok()) << status.error_message();
}

TEST_F(ServiceAdmissionTest, TheLimitsAreTold) {
  options_.memory_limit = 123'456'789;
  options_.build_slots = 7;
  StartGated();
  EXPECT_EQ(Info().limits().memory_bytes(), 123'456'789u);
  EXPECT_EQ(Info().limits().build_slots(), 7u);
}

}  // namespace
}  // namespace treelight::testing
