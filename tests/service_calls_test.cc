#include <future>
#include <map>
#include <thread>

#include "nlohmann/json.hpp"
#include "tests/gated_builder.h"
#include "tests/server_fixture.h"

// Calls as they live: cancelled, late, repeated, expiring, streaming, draining.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

class ServiceCallsTest : public ServerTest {
 protected:
  /// A server behind a gate, with the map "cloud".
  void StartGated() {
    Start(std::make_unique<GatedBuilder>(gate_));
    MustBuild("cloud", photons_);
  }

  grpc::Status Gather(grpc::ClientContext& context, v1::GatherResponse& response) {
    return stub_->Gather(&context, MakeBatch("cloud", {0, 0, 0}, {.k = 1}), &response);
  }

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

TEST_F(ServiceCallsTest, ACancelledGatherStopsAndTheNextRuns) {
  StartGated();
  gate_->open = false;
  grpc::ClientContext context;
  v1::GatherResponse response;
  auto answer = std::async([&] { return Gather(context, response); });
  ASSERT_TRUE(Eventually([&] { return gate_->gathers == 1; }));
  context.TryCancel();
  EXPECT_EQ(answer.get().error_code(), grpc::StatusCode::CANCELLED);
  // The device is only free again if the gather was told to stop: the gate is shut still.
  grpc::ClientContext next;
  auto second = std::async([&] { return Gather(next, response); });
  EXPECT_TRUE(Eventually([&] { return gate_->gathers == 2; }));
  gate_->open = true;
  EXPECT_TRUE(second.get().ok());
}

TEST_F(ServiceCallsTest, APassedDeadlineStopsTheWorkAndIsLoggedAsOne) {
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

TEST_F(ServiceCallsTest, ACallCancelledInTheQueueIsNeverRun) {
  StartGated();
  gate_->open = false;
  grpc::ClientContext first, second;
  v1::GatherResponse first_response, second_response;
  auto running = std::async([&] { return Gather(first, first_response); });
  ASSERT_TRUE(Eventually([&] { return gate_->gathers == 1; }));
  second.set_deadline(std::chrono::system_clock::now() + 50ms);
  EXPECT_EQ(Gather(second, second_response).error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  gate_->open = true;
  EXPECT_TRUE(running.get().ok());
  grpc::ClientContext third;
  EXPECT_TRUE(Gather(third, first_response).ok());
  EXPECT_EQ(gate_->gathers, 2);
}

TEST_F(ServiceCallsTest, AFullQueueIsResourceExhausted) {
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

TEST_F(ServiceCallsTest, ACancelledBuildLeavesNoMap) {
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

TEST_F(ServiceCallsTest, ARepeatedRequestIdAnswersWithTheFirstMap) {
  StartGated();
  auto messages = MakeUpload("once", photons_);
  messages[0].mutable_header()->set_request_id("try-1");
  v1::BuildPhotonMapResponse first, second;
  ASSERT_TRUE(Build(*stub_, messages, first).ok());
  messages[0].mutable_header()->set_name("another");
  const auto status = Build(*stub_, messages, second);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(second.map().SerializeAsString(), first.map().SerializeAsString());
  EXPECT_EQ(gate_->builds, 2);  // of "cloud" and "once"
}

TEST_F(ServiceCallsTest, TwoBuildsAtOnceWithOneRequestIdMakeOneMap) {
  StartGated();
  gate_->open = false;
  auto messages = MakeUpload("once", photons_);
  messages[0].mutable_header()->set_request_id("try-1");
  v1::BuildPhotonMapResponse responses[2];
  std::vector<std::future<grpc::Status>> calls;
  for (auto& response : responses) {
    calls.push_back(
        std::async(std::launch::async, [&] { return Build(*stub_, messages, response); }));
  }
  ASSERT_TRUE(Eventually([&] { return gate_->builds == 2; }));
  std::this_thread::sleep_for(50ms);  // the second waits for the device meanwhile
  gate_->open = true;
  for (auto& call : calls) EXPECT_TRUE(call.get().ok());
  EXPECT_EQ(responses[0].map().SerializeAsString(), responses[1].map().SerializeAsString());
  EXPECT_EQ(gate_->builds, 2);
}

TEST_F(ServiceCallsTest, AMapWithATimeToLiveGoes) {
  StartGated();
  auto messages = MakeUpload("brief", photons_);
  messages[0].mutable_header()->set_time_to_live_ms(100);
  v1::BuildPhotonMapResponse built;
  ASSERT_TRUE(Build(*stub_, messages, built).ok());
  EXPECT_EQ(built.map().expires_unix_ms() - built.map().created_unix_ms(), 100);
  const auto code = [&] {
    v1::GetPhotonMapRequest request;
    request.set_name("brief");
    v1::PhotonMap map;
    grpc::ClientContext context;
    return stub_->GetPhotonMap(&context, request, &map).error_code();
  };
  EXPECT_TRUE(Eventually([&] { return code() == grpc::StatusCode::NOT_FOUND; }));
}

TEST_F(ServiceCallsTest, AGatherOnADeletedMapFinishes) {
  StartGated();
  gate_->open = false;
  grpc::ClientContext context;
  v1::GatherResponse response;
  auto answer = std::async([&] { return Gather(context, response); });
  ASSERT_TRUE(Eventually([&] { return gate_->gathers == 1; }));
  Delete("cloud");
  gate_->open = true;
  EXPECT_TRUE(answer.get().ok());
  EXPECT_EQ(Array<std::uint32_t>(response.counts()), std::vector<std::uint32_t>{1});
}

TEST_F(ServiceCallsTest, AStreamReadsOneBatchAheadAndNoMore) {
  StartGated();
  MustBuild("third", photons_);
  gate_->open = false;
  grpc::ClientContext context;
  const auto stream = stub_->GatherStream(&context);
  // The third write waits for its reader: this channel buffers nothing.
  std::jthread writer([&] {
    for (const char* map : {"cloud", "cloud", "third"}) {
      EXPECT_TRUE(stream->Write(MakeBatch(map, {0, 0, 0}, {.k = 1})));
    }
  });
  ASSERT_TRUE(Eventually([&] { return gate_->gathers == 1; }));
  std::this_thread::sleep_for(100ms);
  // A batch takes up its version when it is read: the second has, the third has not.
  for (const char* map : {"cloud", "third"}) Delete(map);
  gate_->open = true;
  v1::GatherResponse part;
  EXPECT_TRUE(stream->Read(&part));
  EXPECT_TRUE(stream->Read(&part));
  const bool third_answered = stream->Read(&part);
  EXPECT_FALSE(third_answered);
  if (third_answered) context.TryCancel();  // or Finish would wait for ever
  EXPECT_EQ(stream->Finish().error_message(), "no map is named 'third'");
}

TEST_F(ServiceCallsTest, TheFirstErrorOfAStreamComesAfterTheAnswersBeforeIt) {
  StartGated();
  std::vector<v1::GatherRequest> batches(3, MakeBatch("cloud", {0, 0, 0}, {.k = 1}));
  batches[1].set_outputs(0);
  std::vector<v1::GatherResponse> parts;
  EXPECT_EQ(Stream(*stub_, batches, parts).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(parts.size(), 1u);
  EXPECT_EQ(LogOf("GatherStream")["code"], "INVALID_ARGUMENT");
}

TEST_F(ServiceCallsTest, ACancelledStreamStopsItsGathers) {
  StartGated();
  gate_->open = false;
  grpc::ClientContext context;
  const auto stream = stub_->GatherStream(&context);
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(stream->Write(MakeBatch("cloud", {0, 0, 0}, {.k = 1})));
  ASSERT_TRUE(Eventually([&] { return gate_->gathers == 1; }));
  context.TryCancel();
  EXPECT_EQ(stream->Finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(LogOf("GatherStream")["code"],
            "CANCELLED");  // the end of the server waited for it, gate shut
}

TEST_F(ServiceCallsTest, LargeAnswersComeInPartsWithTimesInTheLast) {
  StartGated();
  const GatherOptions options{.k = 50, .outputs = kOutputCount | kOutputNeighbors};
  const auto points = MakePoints(9'000, 3);  // 3.6 MB of neighbours
  std::vector<v1::GatherResponse> parts;
  ASSERT_TRUE(Stream(*stub_, std::vector{MakeBatch("cloud", points, options)}, parts).ok());
  const GatherResult expected = Expected(photons_, points, options);
  std::vector<std::uint32_t> ids, counts;
  EXPECT_GE(parts.size(), 4u);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const bool last = i + 1 == parts.size();
    EXPECT_LE(parts[i].ByteSizeLong(), 1u << 20);
    EXPECT_EQ(parts[i].first_query(), counts.size());
    EXPECT_EQ(parts[i].last(), last);
    EXPECT_EQ(parts[i].has_timings(), last);
    for (const auto count : Array<std::uint32_t>(parts[i].counts())) counts.push_back(count);
    for (const auto id : Array<std::uint32_t>(parts[i].neighbor_ids())) ids.push_back(id);
    EXPECT_EQ(parts[i].first_query() + parts[i].query_count(), counts.size());
  }
  EXPECT_EQ(counts, expected.counts);
  EXPECT_EQ(ids, expected.neighbor_ids);
}

TEST_F(ServiceCallsTest, UncappedListsAgreeWithBruteForce) {
  StartGated();
  const GatherOptions options{.k = 0, .radius = 0.3f, .outputs = kOutputNeighbors};
  const auto points = MakePoints(101, 3);
  std::vector<v1::GatherResponse> parts;
  ASSERT_TRUE(Stream(*stub_, std::vector{MakeBatch("cloud", points, options)}, parts).ok());
  ASSERT_EQ(parts.size(), 1u);
  const GatherResult expected = Expected(photons_, points, options);
  EXPECT_EQ(Array<std::uint64_t>(parts[0].neighbor_offsets()), expected.neighbor_offsets);
  EXPECT_EQ(Array<std::uint32_t>(parts[0].neighbor_ids()), expected.neighbor_ids);
  EXPECT_EQ(Array<float>(parts[0].neighbor_squared_distances()),
            expected.neighbor_squared_distances);
}

TEST_F(ServiceCallsTest, ADrainLetsOpenCallsFinishAndRefusesNewOnes) {
  StartGated();
  gate_->open = false;
  grpc::ClientContext context, late;
  v1::GatherResponse response, late_response;
  auto answer = std::async([&] { return Gather(context, response); });
  ASSERT_TRUE(Eventually([&] { return gate_->gathers == 1; }));
  auto drained = std::async([&] { return server_->Drain(std::chrono::system_clock::now() + 10s); });
  // Calls are refused from some moment on; until then they wait in the queue behind the gate.
  ASSERT_TRUE(Eventually([&] {
    grpc::ClientContext probe;
    v1::ServerInfo info;
    return stub_->GetServerInfo(&probe, {}, &info).error_code() == grpc::StatusCode::UNAVAILABLE;
  }));
  EXPECT_EQ(Gather(late, late_response).error_message(),
            "the server is stopping and takes no new calls");
  gate_->open = true;
  EXPECT_TRUE(answer.get().ok());
  EXPECT_EQ(drained.get(), 0u);
}

TEST_F(ServiceCallsTest, ADrainCancelsWhatIsOpenAtItsEnd) {
  StartGated();
  gate_->open = false;
  grpc::ClientContext context;
  v1::GatherResponse response;
  auto answer = std::async([&] { return Gather(context, response); });
  ASSERT_TRUE(Eventually([&] { return gate_->gathers == 1; }));
  EXPECT_EQ(server_->Drain(std::chrono::system_clock::now() + 20ms), 1u);
  EXPECT_FALSE(answer.get().ok());
}

TEST_F(ServiceCallsTest, ACallRefusedInADrainIsLogged) {
  DeviceInfo device;
  device.name = "drained";
  device.memory_bytes = device.max_buffer_bytes = 1 << 30;
  options_.devices = {device};
  StartGated();
  // An upload that stands still keeps the drain from its end.
  grpc::ClientContext open, late, late_stream;
  v1::BuildPhotonMapResponse built;
  const auto upload = stub_->BuildPhotonMap(&open, &built);
  ASSERT_TRUE(upload->Write(MakeUpload("standing", photons_)[0]));
  v1::ServerInfo info;
  grpc::ClientContext first;
  ASSERT_TRUE(stub_->GetServerInfo(&first, {}, &info).ok());  // the upload was taken up before
  auto drained = std::async([&] { return server_->Drain(std::chrono::system_clock::now() + 10s); });
  ASSERT_TRUE(Eventually([&] {
    grpc::ClientContext probe;
    return stub_->GetServerInfo(&probe, {}, &info).error_code() == grpc::StatusCode::UNAVAILABLE;
  }));
  v1::GatherResponse response;
  EXPECT_EQ(Gather(late, response).error_code(), grpc::StatusCode::UNAVAILABLE);
  const auto stream = stub_->GatherStream(&late_stream);
  EXPECT_FALSE(stream->Read(&response));
  EXPECT_EQ(stream->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  open.TryCancel();
  EXPECT_FALSE(upload->Finish().ok());
  drained.get();

  const auto lines = LogByMethod();
  for (const char* method : {"GetServerInfo", "Gather", "GatherStream"}) {
    ASSERT_TRUE(lines.contains(method)) << method;
    EXPECT_EQ(lines.at(method)["code"], "UNAVAILABLE") << method;
    EXPECT_NE(lines.at(method)["peer"], "") << method;
  }
  EXPECT_EQ(lines.at("Gather")["map"], "cloud");
  EXPECT_EQ(lines.at("Gather")["queries"], 1);
  EXPECT_EQ(lines.at("Gather")["k"], 1);
  EXPECT_EQ(lines.at("Gather")["r"], "inf");
  for (const char* method : {"BuildPhotonMap", "Gather", "GatherStream"}) {
    EXPECT_EQ(lines.at(method)["device"], "drained") << method;
  }
}

TEST_F(ServiceCallsTest, AStreamWithoutBatchesIsLogged) {
  StartGated();
  std::vector<v1::GatherResponse> parts;
  ASSERT_TRUE(Stream(*stub_, {}, parts).ok());
  const auto log = LogOf("GatherStream");
  EXPECT_EQ(log["code"], "OK");
  EXPECT_FALSE(log.contains("queries"));
}

TEST_F(ServiceCallsTest, TheLogOfALookTellsTheVersionThatAnswered) {
  StartGated();
  v1::GetPhotonMapRequest request;
  request.set_name("cloud");
  v1::PhotonMap map;
  grpc::ClientContext context;
  ASSERT_TRUE(stub_->GetPhotonMap(&context, request, &map).ok());
  EXPECT_EQ(LogOf("GetPhotonMap")["version"], 1);
}

TEST_F(ServiceCallsTest, TheLogTellsWhatTheAnswerTells) {
  StartGated();
  auto request = MakeBatch("cloud", {0, 0, 0, 1, 1, 1}, {.k = 3, .outputs = kOutputStatistics});
  request.clear_radius();
  grpc::ClientContext context;
  context.AddMetadata("x-request-id", "frame-7");
  v1::GatherResponse response;
  ASSERT_TRUE(stub_->Gather(&context, request, &response).ok());
  const auto log = LogOf("Gather");
  EXPECT_EQ(log["request_id"], "frame-7");
  EXPECT_EQ(log["map"], "cloud");
  EXPECT_EQ(log["version"], 1);
  EXPECT_EQ(log["queries"], 2);
  EXPECT_EQ(log["k"], 3);
  EXPECT_EQ(log["r"], "inf");
  EXPECT_EQ(log["bytes_in"], request.ByteSizeLong());
  EXPECT_EQ(log["bytes_out"], response.ByteSizeLong());
  EXPECT_EQ(log["distance_tests"], 2000);
  EXPECT_EQ(log["nodes_visited"], 0);
  EXPECT_EQ(log["code"], "OK");
  EXPECT_NEAR(log["queue_us"].get<double>(), response.timings().queue_us(), 0.06);
  EXPECT_NEAR(log["total_us"].get<double>(), response.timings().total_us(), 0.06);
}

}  // namespace
}  // namespace treelight::testing
