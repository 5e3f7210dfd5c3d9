#include <future>
#include <string>
#include <vector>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "tests/gated_service.h"

// What a server without room refuses, and that it has room again afterwards.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

/// What grpc-status-details-bin says.
struct Details {
  std::string quota;          ///< subject of the QuotaFailure
  std::string description;    ///< of the same
  double retry_seconds = -1;  ///< of the RetryInfo; -1: there is none
};

Details ReadDetails(const grpc::Status& status) {
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

class ServiceAdmissionTest : public GatedServiceTest {
 protected:
  /// A BuildPhotonMap call that has sent the header of `upload` and stands still.
  struct OpenBuild {
    grpc::ClientContext context;
    v1::BuildPhotonMapResponse response;
    std::unique_ptr<grpc::ClientWriter<v1::BuildPhotonMapRequest>> writer;

    grpc::Status Finish(std::span<const v1::BuildPhotonMapRequest> rest) {
      for (const auto& message : rest) {
        if (!writer->Write(message)) break;
      }
      writer->WritesDone();
      return writer->Finish();
    }
  };

  std::unique_ptr<OpenBuild> BeginBuild(const v1::BuildPhotonMapRequest& header) {
    auto build = std::make_unique<OpenBuild>();
    build->writer = stub_->BuildPhotonMap(&build->context, &build->response);
    EXPECT_TRUE(build->writer->Write(header));
    return build;
  }

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

  /// A stream's batch of which the lists are 62 MiB, answered whole.
  void GatherLongAnswer() {
    const auto batch =
        MakeBatch("cloud", MakePoints(2000, 2), {.k = 4096, .outputs = kOutputNeighbors});
    std::vector<v1::GatherResponse> parts;
    const auto status = Stream(*stub_, {&batch, 1}, parts);
    ASSERT_TRUE(status.ok()) << status.error_message();
    std::size_t queries = 0;
    for (const auto& part : parts) queries += part.query_count();
    EXPECT_EQ(queries, 2000u);
    EXPECT_TRUE(AllGivenBack());
  }
};

TEST_F(ServiceAdmissionTest, AnUploadOverTheMemoryLimitIsRefusedBeforeItsChunksAreRead) {
  options_.memory_limit = 8 << 20;
  StartGated();
  auto upload = MakeUpload("large", photons_);
  upload[0].mutable_header()->set_photon_count(1'000'000);  // 28 MB
  const auto build = BeginBuild(upload[0]);
  // No chunk is sent: the answer does not wait for one.
  const auto status = build->writer->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(status.error_message(),
            "header.photon_count is 1000000: 32194304 bytes of the server's memory, the limit is "
            "8388608 (--memory-limit), of which 0 are held (uploads 0, messages 0, answers 0, maps "
            "0); ask for less");
  const Details details = ReadDetails(status);
  EXPECT_EQ(details.quota, "memory");
  EXPECT_EQ(details.description, status.error_message());
  EXPECT_EQ(details.retry_seconds, -1);  // no repeat helps
  EXPECT_TRUE(AllGivenBack());
}

TEST_F(ServiceAdmissionTest, AnUploadThatFitsLaterIsToldWhen) {
  options_.memory_limit = 40 << 20;
  StartGated();
  auto upload = MakeUpload("first", photons_);
  upload[0].mutable_header()->set_photon_count(1'000'000);
  const auto first = BeginBuild(upload[0]);
  ASSERT_TRUE(Eventually([&] { return Info().memory_bytes_used() == 32'194'304; }));
  const auto second = BeginBuild(upload[0]);
  const auto status = second->writer->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  const Details details = ReadDetails(status);
  EXPECT_EQ(details.quota, "memory");
  EXPECT_GE(details.retry_seconds, 0.1);
  EXPECT_LE(details.retry_seconds, 30);

  first->context.TryCancel();
  EXPECT_FALSE(first->writer->Finish().ok());
  EXPECT_TRUE(AllGivenBack());
  EXPECT_EQ(MustBuild("second", photons_).version(), 1u);
}

TEST_F(ServiceAdmissionTest, MapsOfACpuCountAndAreGivenBackWhenTheyGo) {
  DeviceInfo device;
  device.type = "cpu";
  device.memory_bytes = device.max_buffer_bytes = std::uint64_t{1} << 40;
  options_.devices = {device};
  options_.memory_limit = 90 << 20;
  StartGated();
  // What the map says that it holds, no more of what was foreseen.
  EXPECT_TRUE(Eventually([&] { return Info().memory_bytes_used() == Info().device_bytes_used(); }));
  auto upload = MakeUpload("huge", photons_);
  upload[0].mutable_header()->set_photon_count(1'000'000);  // 32 MB and a map of 72 MB
  const auto status = BeginBuild(upload[0])->writer->Finish();
  EXPECT_EQ(ReadDetails(status).quota, "memory");
  // Each of both would fit, together they never do: that is what the client has to know.
  EXPECT_EQ(ReadDetails(status).retry_seconds, -1);
  EXPECT_EQ(status.error_message().find("header.photon_count is 1000000: 104194304 bytes"), 0u)
      << status.error_message();
  Delete("cloud");
  EXPECT_TRUE(AllGivenBack());
}

TEST_F(ServiceAdmissionTest, BuildsOverTheirSlotsAreRefusedAndOneGoesOnAfterwards) {
  options_.build_slots = 1;
  StartGated();
  const auto upload = MakeUpload("cloud2", photons_);
  const auto first = BeginBuild(upload[0]);
  ASSERT_TRUE(Eventually([&] { return Info().memory_bytes_used() > 0; }));
  const auto status = BeginBuild(upload[0])->writer->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(status.error_message(),
            "builds: 1 are open already, the limit is 1 (--build-slots); repeat later");
  EXPECT_EQ(ReadDetails(status).quota, "builds");
  EXPECT_GE(ReadDetails(status).retry_seconds, 0.1);
  EXPECT_TRUE(first->Finish(std::span(upload).subspan(1)).ok());
  ASSERT_TRUE(AllGivenBack());
  EXPECT_EQ(MustBuild("cloud2", photons_).version(), 2u);
}

TEST_F(ServiceAdmissionTest, AQueueThatCannotMeetTheDeadlineRefusesAtOnce) {
  StartGated();
  // A gather that is known to take 200 ms, and one of its kind that holds the device.
  {
    const auto slow = GatherAtGate();
    std::this_thread::sleep_for(200ms);
    gate_->open = true;
    ASSERT_TRUE(slow->status.get().ok());
  }
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
  {
    const auto slow = GatherAtGate();
    std::this_thread::sleep_for(300ms);
    gate_->open = true;
    ASSERT_TRUE(slow->status.get().ok());
  }
  // By the estimate it would be late; only trying shows that it is fast again.
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + 200ms);
  v1::GatherResponse response;
  const auto status = Gather(context, response);
  EXPECT_TRUE(status.ok()) << status.error_message();
}

TEST_F(ServiceAdmissionTest, AnAnswerOverTheMemoryLimitIsRefusedAndGivenBack) {
  options_.memory_limit = 5 << 20;
  options_.limits.max_part_bytes = 4 << 20;
  StartGated();
  const auto batch =
      MakeBatch("cloud", MakePoints(2000, 2), {.k = 4096, .outputs = kOutputNeighbors});
  std::vector<v1::GatherResponse> parts;
  // The first slice is as large as a part, and as much is on its way.
  const auto status = Stream(*stub_, {&batch, 1}, parts);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ReadDetails(status).quota, "memory");
  EXPECT_EQ(status.error_message().find("batch of 2000 queries, k 4096: "), 0u)
      << status.error_message();
  EXPECT_EQ(gate_->gathers, 0);
  EXPECT_TRUE(AllGivenBack());
}

TEST_F(ServiceAdmissionTest, SlicesGrowAsTheyAreTaken) {
  StartGated();
  GatherLongAnswer();
  EXPECT_LT(gate_->gathers, 25);  // 7, of 1, 2, 4, 8 and 16 MiB, where each takes little time
}

TEST_F(ServiceAdmissionTest, SlicesStaySmallWhereMemoryIsShort) {
  options_.memory_limit = 5 << 20;
  StartGated();
  GatherLongAnswer();
  EXPECT_GT(gate_->gathers, 25);  // 32, of 2 MiB
}

TEST_F(ServiceAdmissionTest, ListsWithoutACapArePaidForByTheirLength) {
  options_.limits.max_neighbors = 1 << 20;  // 8 MiB while they are gathered
  options_.memory_limit = 9 << 20;
  StartGated();
  const auto batch =
      MakeBatch("cloud", MakePoints(500, 2), {.k = 0, .radius = 10, .outputs = kOutputNeighbors});
  std::vector<v1::GatherResponse> parts;
  const auto status = Stream(*stub_, {&batch, 1}, parts);  // 4 MB
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_TRUE(AllGivenBack());
}

TEST_F(ServiceAdmissionTest, ListsThatMightNotFitAreRefusedAndThoseThatAreHereAreHeld) {
  options_.limits.max_neighbors = 1 << 20;
  options_.memory_limit = 8 << 20;  // not a byte for anything else
  StartGated();
  const GatherOptions lists{.k = 0, .radius = 10, .outputs = kOutputNeighbors};
  const auto large = MakeBatch("cloud", MakePoints(2000, 2), lists);
  std::vector<v1::GatherResponse> parts;
  auto status = Stream(*stub_, {&large, 1}, parts);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ReadDetails(status).quota, "memory");
  EXPECT_EQ(gate_->gathers, 0);
  // No list is longer than the map: a few queries need little.
  const auto small = MakeBatch("cloud", MakePoints(5, 2), lists);
  status = Stream(*stub_, {&small, 1}, parts);
  EXPECT_TRUE(status.ok()) << status.error_message();

  // A CPU searches in host memory too, 40 B for each of 500 * 1000 neighbours.
  DeviceInfo cpu;
  cpu.type = "cpu";
  cpu.memory_bytes = cpu.max_buffer_bytes = std::uint64_t{1} << 40;
  options_.devices = {cpu};
  options_.memory_limit = 20 << 20;
  StartGated();
  const auto batch = MakeBatch("cloud", MakePoints(500, 2), lists);
  status = Stream(*stub_, {&batch, 1}, parts);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ReadDetails(status).quota, "memory");

  options_.devices.clear();
  options_.memory_limit = 9 << 20;
  StartGated();
  grpc::ClientContext context;
  const auto stream = stub_->GatherStream(&context);
  ASSERT_TRUE(stream->Write(batch));
  ASSERT_TRUE(Eventually([&] { return gate_->gathers == 2; }));
  // Gathered and not read: what they are, no more what they might have been.
  EXPECT_TRUE(Eventually([&] { return Info().memory_bytes_used() < 8u << 20; }));
  EXPECT_GE(Info().memory_bytes_used(), 500 * 1000 * 8u);
  context.TryCancel();
  stream->Finish();
  EXPECT_TRUE(AllGivenBack());
}

TEST_F(ServiceAdmissionTest, AStreamThatIsNotReadHoldsASliceOrTwo) {
  options_.limits.max_slice_bytes = 1 << 20;
  options_.limits.max_part_bytes = 1 << 18;
  StartGated();
  // 26 MB of answers, of which the client takes none; slices of more queries than go together.
  const auto batch =
      MakeBatch("cloud", MakePoints(8000, 2), {.k = 400, .outputs = kOutputNeighbors});
  grpc::ClientContext context;
  const auto stream = stub_->GatherStream(&context);
  ASSERT_TRUE(stream->Write(batch));
  ASSERT_TRUE(stream->Write(batch));
  ASSERT_TRUE(Eventually([&] { return gate_->gathers >= 2; }));
  std::uint64_t most = 0;
  for (int i = 0; i < 50; ++i) {
    most = std::max(most, Info().memory_bytes_used());
    std::this_thread::sleep_for(10ms);
  }
  // Two slices, the parts of each twice, and two requests of 96 kB three times.
  EXPECT_LE(most, 2 * ((1u << 20) + (1u << 19)) + 6 * 100'000u);
  EXPECT_LE(gate_->gathers, 40);
  context.TryCancel();
  stream->Finish();
  EXPECT_TRUE(AllGivenBack());
}

TEST_F(ServiceAdmissionTest, SlicesTogetherAreTheAnswer) {
  options_.limits.max_slice_bytes = 8 * 50 * 70;  // 70 queries
  options_.limits.max_part_bytes = 8 * 50 * 30;   // 27 queries, with room for the rest
  StartGated();
  const auto points = MakePoints(500, 2);
  const GatherOptions gather{.k = 50, .outputs = kOutputNeighbors | kOutputCount | kOutputRadius};
  const auto batch = MakeBatch("cloud", points, gather);
  std::vector<v1::GatherResponse> parts;
  ASSERT_TRUE(Stream(*stub_, {&batch, 1}, parts).ok());
  EXPECT_GE(gate_->gathers, 500 / 70);
  v1::GatherResponse whole;
  for (const auto& part : parts) {
    EXPECT_EQ(part.first_query(), whole.counts().size() / 4);
    EXPECT_EQ(part.last(), &part == &parts.back());
    whole.mutable_counts()->append(part.counts());
    whole.mutable_radii()->append(part.radii());
    whole.mutable_neighbor_ids()->append(part.neighbor_ids());
    whole.mutable_neighbor_squared_distances()->append(part.neighbor_squared_distances());
  }
  const GatherResult expected = Expected(photons_, points, gather);
  EXPECT_EQ(Array<std::uint32_t>(whole.counts()), expected.counts);
  EXPECT_EQ(Array<float>(whole.radii()), expected.radii);
  EXPECT_EQ(Array<std::uint32_t>(whole.neighbor_ids()), expected.neighbor_ids);
  EXPECT_EQ(Array<float>(whole.neighbor_squared_distances()), expected.neighbor_squared_distances);
}

TEST_F(ServiceAdmissionTest, AnUploadThatStandsStillIsCutOffAndItsSlotIsFree) {
  options_.stall = 100ms;
  options_.build_slots = 1;
  StartGated();
  const auto stuck = BeginBuild(MakeUpload("stuck", photons_)[0]);
  EXPECT_EQ(stuck->writer->Finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_TRUE(AllGivenBack());
  EXPECT_EQ(MustBuild("healthy", photons_).version(), 1u);
  const auto lines = EndAndReadLog();
  EXPECT_TRUE(std::ranges::any_of(lines, [](const std::string& line) {
    return line.find("neither sent nor taken anything for 100 ms (--stall-seconds)") !=
           std::string::npos;
  }));
}

TEST_F(ServiceAdmissionTest, AReaderThatStandsStillIsCutOffAndAnIdleStreamIsNot) {
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
  ASSERT_TRUE(Eventually([&] { return Info().memory_bytes_used() > 0; }));
  EXPECT_TRUE(AllGivenBack());  // though nothing was read
  EXPECT_EQ(stuck->Finish().error_code(), grpc::StatusCode::CANCELLED);

  std::this_thread::sleep_for(400ms);
  ASSERT_TRUE(idle->Write(small));
  EXPECT_TRUE(idle->Read(&part));
  idle->WritesDone();
  EXPECT_TRUE(idle->Finish().ok());
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
