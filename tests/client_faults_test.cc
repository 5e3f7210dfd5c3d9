// The client library against servers that fail, stall or answer nonsense.
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "client/photon_map_client.h"
#include "client/status.h"
#include "gmock/gmock.h"
#include "google/protobuf/util/time_util.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "gtest/gtest.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::client {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr std::chrono::milliseconds kTimeout{300};

/// A server that does what a test says.
class FaultyService : public v1::PhotonMapService::Service {
 public:
  using Stream = grpc::ServerReaderWriter<v1::GatherResponse, v1::GatherRequest>;

  grpc::Status GetServerInfo(grpc::ServerContext*, const v1::GetServerInfoRequest*,
                             v1::ServerInfo* info) override {
    info->mutable_limits()->set_max_queries(2);
    return grpc::Status::OK;
  }
  grpc::Status GetPhotonMap(grpc::ServerContext*, const v1::GetPhotonMapRequest*,
                            v1::PhotonMap* map) override {
    map->set_name("map");
    map->set_version(1);
    return grpc::Status::OK;
  }
  grpc::Status GatherStream(grpc::ServerContext* context, Stream* stream) override {
    return gather_stream(*context, *stream);
  }
  grpc::Status Gather(grpc::ServerContext*, const v1::GatherRequest*,
                      v1::GatherResponse*) override {
    return grpc::Status::OK;  // an empty answer
  }
  grpc::Status BuildPhotonMap(grpc::ServerContext*,
                              grpc::ServerReader<v1::BuildPhotonMapRequest>* reader,
                              v1::BuildPhotonMapResponse* response) override {
    v1::BuildPhotonMapRequest request;
    while (reader->Read(&request)) {
      if (request.has_header()) request_ids.push_back(request.header().request_id());
    }
    return build(*response);
  }

  std::function<grpc::Status(grpc::ServerContext&, Stream&)> gather_stream;
  std::function<grpc::Status(v1::BuildPhotonMapResponse&)> build;
  std::vector<std::string> request_ids;  // of every build, in order
};

class ClientFaultsTest : public testing::Test {
 protected:
  ClientFaultsTest() : server_(grpc::ServerBuilder().RegisterService(&service_).BuildAndStart()) {}

  std::shared_ptr<grpc::Channel> Channel() { return server_->InProcessChannel({}); }

  /// Gathers at three points, two batches, on version 1.
  absl::Status Gather(PhotonMapClient& client) {
    const std::vector<float> positions(9);
    return client
        .Gather({.name = "map", .version = 1}, {.positions = positions, .normals = {}, .radii = {}},
                {.k = 1})
        .status();
  }

  FaultyService service_;
  std::unique_ptr<grpc::Server> server_;
};

/// A right answer to `request`, which asks for counts.
v1::GatherResponse Answer(const v1::GatherRequest& request) {
  v1::GatherResponse response;
  response.set_batch_id(request.batch_id());
  response.set_map(request.map());
  response.set_version(1);
  const std::size_t query_count = request.positions().size() / 12;
  response.set_query_count(static_cast<std::uint32_t>(query_count));
  response.set_last(true);
  response.set_counts(std::string(4 * query_count, '\0'));
  return response;
}

TEST_F(ClientFaultsTest, ABuildThatBreaksIsRepeatedWithTheSameRequestId) {
  int attempt_count = 0;
  service_.build = [&](v1::BuildPhotonMapResponse& response) {
    if (++attempt_count == 1) return grpc::Status(grpc::StatusCode::UNAVAILABLE, "cut");
    response.mutable_map()->set_name("map");
    response.mutable_map()->set_version(7);
    return grpc::Status::OK;
  };
  PhotonMapClient client(Channel());
  const auto built =
      client.BuildPhotonMap("map", {.positions = {1, 2, 3}, .powers = {}, .directions = {}});
  ASSERT_TRUE(built.ok()) << built.status();
  EXPECT_EQ(built->map().version(), 7u);
  ASSERT_EQ(service_.request_ids.size(), 2u);
  EXPECT_EQ(service_.request_ids[0], service_.request_ids[1]);
  EXPECT_EQ(service_.request_ids[0].size(), 32u);
}

TEST_F(ClientFaultsTest, ABuildThatFailsIsNotRetriedForEver) {
  service_.build = [](v1::BuildPhotonMapResponse&) {
    return grpc::Status(grpc::StatusCode::UNAVAILABLE, "cut");
  };
  PhotonMapClient client(Channel());
  EXPECT_EQ(client.BuildPhotonMap("map", {}).status(), absl::UnavailableError("cut"));
  EXPECT_EQ(service_.request_ids.size(), 5u);
  service_.build = [](v1::BuildPhotonMapResponse&) {
    return grpc::Status(grpc::StatusCode::INTERNAL, "broken");
  };
  EXPECT_EQ(client.BuildPhotonMap("map", {}).status(), absl::InternalError("broken"));
  EXPECT_EQ(service_.request_ids.size(), 6u);
}

TEST_F(ClientFaultsTest, TheNewestMayBeDeletedWhileItIsAskedFor) {
  int stream_count = 0;
  service_.gather_stream = [&](grpc::ServerContext&, FaultyService::Stream& stream) {
    if (++stream_count == 1) return grpc::Status(grpc::StatusCode::NOT_FOUND, "deleted");
    v1::GatherRequest request;
    while (stream.Read(&request)) stream.Write(Answer(request));
    return grpc::Status::OK;
  };
  PhotonMapClient client(Channel());
  const std::vector<float> positions(9);  // two batches: the version is asked for first
  const auto newest = client.Gather({.name = "map"}, {.positions = positions}, {.k = 1});
  EXPECT_TRUE(newest.ok()) << newest.status();
  EXPECT_EQ(stream_count, 2);
  // Whoever asks for one version wants no other.
  stream_count = 0;
  EXPECT_EQ(Gather(client), absl::NotFoundError("deleted"));
  EXPECT_EQ(stream_count, 1);
}

/// A refusal that says when to repeat.
grpc::Status Refused(std::chrono::milliseconds delay) {
  google::rpc::RetryInfo retry;
  *retry.mutable_retry_delay() =
      google::protobuf::util::TimeUtil::MillisecondsToDuration(delay.count());
  google::rpc::Status details;
  details.set_code(grpc::StatusCode::RESOURCE_EXHAUSTED);
  details.add_details()->PackFrom(retry);
  return {grpc::StatusCode::RESOURCE_EXHAUSTED, "no room: the limit is 3",
          details.SerializeAsString()};
}

TEST_F(ClientFaultsTest, ARefusedBuildIsRepeatedWhenTheServerSaid) {
  int attempt_count = 0;
  service_.build = [&](v1::BuildPhotonMapResponse& response) {
    if (++attempt_count <= 2) return Refused(std::chrono::milliseconds(50));
    response.mutable_map()->set_name("map");
    response.mutable_map()->set_version(7);
    return grpc::Status::OK;
  };
  PhotonMapClient client(Channel(), std::chrono::seconds(20));
  const auto begun = std::chrono::steady_clock::now();
  const auto built =
      client.BuildPhotonMap("map", {.positions = {1, 2, 3}, .powers = {}, .directions = {}});
  ASSERT_TRUE(built.ok()) << built.status();
  // 50 ms, then twice that.
  EXPECT_GE(std::chrono::steady_clock::now() - begun, std::chrono::milliseconds(150));
  ASSERT_EQ(service_.request_ids.size(), 3u);
  EXPECT_EQ(service_.request_ids[0], service_.request_ids[2]);
}

TEST_F(ClientFaultsTest, ARefusalIsNotRepeatedPastTheDeadlineOrThePatience) {
  service_.build = [](v1::BuildPhotonMapResponse&) { return Refused(std::chrono::seconds(5)); };
  const absl::Status expected(absl::StatusCode::kResourceExhausted,
                              "no room: the limit is 3 (the server expects room in 5000 ms)");
  PhotonMapClient late(Channel(), std::chrono::seconds(2));
  EXPECT_EQ(
      late.BuildPhotonMap("map", {}).status().ToString(absl::StatusToStringMode::kWithNoExtraData),
      expected.ToString());
  EXPECT_EQ(service_.request_ids.size(), 1u);
  PhotonMapClient impatient(Channel());
  impatient.SetRetryPatience(std::chrono::seconds(4));
  EXPECT_FALSE(impatient.BuildPhotonMap("map", {}).ok());
  EXPECT_EQ(service_.request_ids.size(), 2u);

  // Where there is neither, the pauses end nevertheless.
  service_.build = [](v1::BuildPhotonMapResponse&) {
    return Refused(std::chrono::milliseconds(1));
  };
  PhotonMapClient patient(Channel());
  patient.SetRetryPatience(std::chrono::milliseconds(100));
  EXPECT_FALSE(patient.BuildPhotonMap("map", {}).ok());
  EXPECT_LE(service_.request_ids.size(), 2u + 5u);
}

TEST_F(ClientFaultsTest, AnExhaustionThatNoTimeMendsIsNotRepeated) {
  service_.build = [](v1::BuildPhotonMapResponse&) {
    return grpc::Status(grpc::StatusCode::RESOURCE_EXHAUSTED, "too large");
  };
  PhotonMapClient client(Channel());
  EXPECT_EQ(client.BuildPhotonMap("map", {}).status(), absl::ResourceExhaustedError("too large"));
  EXPECT_EQ(service_.request_ids.size(), 1u);
}

TEST_F(ClientFaultsTest, ABuildThatNamesNoMapIsInternal) {
  service_.build = [](v1::BuildPhotonMapResponse&) { return grpc::Status::OK; };
  PhotonMapClient client(Channel());
  EXPECT_EQ(client.BuildPhotonMap("map", {}).status().code(), absl::StatusCode::kInternal);
}

TEST_F(ClientFaultsTest, AnEmptyUnaryAnswerIsInternal) {
  PhotonMapClient client(Channel());
  const std::vector<float> position(3);
  const auto answer =
      client.Gather({.name = "map"}, {.positions = position, .normals = {}, .radii = {}}, {.k = 1});
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(answer.status().message()), HasSubstr("malformed answer"));
}

TEST_F(ClientFaultsTest, EveryBatchAsksForTheVersionThatWasNewestAtFirst) {
  std::vector<std::uint64_t> versions;  // that the batches ask for
  service_.gather_stream = [&](grpc::ServerContext&, FaultyService::Stream& stream) {
    v1::GatherRequest request;
    while (stream.Read(&request)) {
      versions.push_back(request.version());
      stream.Write(Answer(request));
    }
    return grpc::Status::OK;
  };
  PhotonMapClient client(Channel());
  const std::vector<float> positions(15);
  const auto answer = client.Gather({.name = "map"},
                                    {.positions = positions, .normals = {}, .radii = {}}, {.k = 1});
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->map.version, 1u);
  EXPECT_THAT(versions, testing::ElementsAre(1, 1, 1));
}

TEST_F(ClientFaultsTest, AStreamThatEndsEarlyIsInternal) {
  service_.gather_stream = [](grpc::ServerContext&, FaultyService::Stream& stream) {
    v1::GatherRequest request;
    if (stream.Read(&request)) stream.Write(Answer(request));
    return grpc::Status::OK;  // with a batch unanswered
  };
  PhotonMapClient client(Channel());
  const auto status = Gather(client);
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("ended the stream before it answered every batch"));
}

TEST_F(ClientFaultsTest, AnAnswerToNoBatchIsInternal) {
  service_.gather_stream = [](grpc::ServerContext&, FaultyService::Stream& stream) {
    v1::GatherRequest request;
    stream.Read(&request);
    stream.Write(Answer(request));
    stream.Write(Answer(request));
    stream.Write(Answer(request));
    while (stream.Read(&request)) continue;
    return grpc::Status::OK;
  };
  PhotonMapClient client(Channel());
  EXPECT_EQ(Gather(client).code(), absl::StatusCode::kInternal);
}

TEST_F(ClientFaultsTest, AStreamThatBreaksSaysSo) {
  service_.gather_stream = [](grpc::ServerContext&, FaultyService::Stream&) {
    return grpc::Status(grpc::StatusCode::UNAVAILABLE, "draining");
  };
  PhotonMapClient client(Channel());
  EXPECT_EQ(Gather(client), absl::UnavailableError("draining"));
}

/// Reads nothing and answers nothing until the client gives up.
grpc::Status Stall(grpc::ServerContext& context, FaultyService::Stream&) {
  while (!context.IsCancelled()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  return grpc::Status::CANCELLED;
}

TEST_F(ClientFaultsTest, AServerThatStallsExceedsTheDeadline) {
  service_.gather_stream = Stall;
  PhotonMapClient client(Channel(), kTimeout);
  const auto began = std::chrono::steady_clock::now();
  EXPECT_EQ(Gather(client).code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_LT(std::chrono::steady_clock::now() - began, 20 * kTimeout);
}

TEST_F(ClientFaultsTest, APipelineToAServerThatStallsEndsItsSendsAndReceives) {
  service_.gather_stream = Stall;
  PhotonMapClient client(Channel(), kTimeout);
  const std::vector<float> positions(30'000);
  const GatherQueries queries{.positions = positions, .normals = {}, .radii = {}};
  GatherPipeline receiving(client, {.name = "map"}, {.k = 1});
  ASSERT_TRUE(receiving.Send(queries).ok());
  EXPECT_EQ(receiving.Receive().status().code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_FALSE(receiving.Receive().ok());
  GatherPipeline sending(client, {.name = "map"}, {.k = 1});
  absl::Status status;
  for (int batch = 0; status.ok() && batch < 1000; ++batch) status = sending.Send(queries);
  EXPECT_EQ(status.code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_EQ(sending.Send(queries).code(), absl::StatusCode::kDeadlineExceeded);
}

TEST(StatusTest, WhatGrpcFindsTooLargeSaysWhatToDo) {
  const auto message = [](grpc::StatusCode code, const char* text) {
    return std::string(ToAbslStatus({code, text}).message());
  };
  const auto full = grpc::StatusCode::RESOURCE_EXHAUSTED;
  EXPECT_THAT(message(full, "Received message larger than max (9 vs. 8)"),
              AllOf(HasSubstr("fewer queries a batch"), HasSubstr("(9 vs. 8)")));
  EXPECT_THAT(message(full, "received initial metadata size exceeds limit"),
              HasSubstr("the token above all"));
  EXPECT_EQ(message(full, "queue is full"), "queue is full");
  EXPECT_EQ(message(grpc::StatusCode::INTERNAL, "message larger than max"),
            "message larger than max");
}

}  // namespace
}  // namespace treelight::client
