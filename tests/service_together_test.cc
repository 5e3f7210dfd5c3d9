#include <future>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "core/model/half.h"
#include "gmock/gmock.h"
#include "server/gather_together.h"
#include "tests/gated_service.h"
#include "tests/waiting_requests.h"

// Batches of a few queries that go to the device together.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;
using ::testing::Each;

constexpr std::uint32_t kLists = kOutputCount | kOutputRadius | kOutputNeighbors;

class ServiceTogetherTest : public GatedServiceTest {
 protected:
  ServiceTogetherTest() { options_.metrics_listen = "127.0.0.1:0"; }

  struct Call {
    std::vector<float> positions;
    GatherOptions options;
    v1::FloatFormat floats;
    grpc::ClientContext context;
    v1::GatherResponse response;
    std::future<grpc::Status> status;
  };

  /// Sends a batch that has to wait, since `first_` stands at the gate.
  Call& Send(std::size_t queries, const GatherOptions& options,
             std::chrono::milliseconds timeout = std::chrono::minutes(1),
             v1::FloatFormat floats = v1::FLOAT_FORMAT_FLOAT32) {
    Call& call = *calls_.emplace_back(std::make_unique<Call>());
    call.positions = MakePoints(queries, static_cast<std::uint32_t>(calls_.size()));
    call.options = options;
    call.floats = floats;
    call.context.set_deadline(std::chrono::system_clock::now() + timeout);
    call.status = std::async(std::launch::async, [this, &call] {
      v1::GatherRequest request = MakeBatch("cloud", call.positions, call.options);
      request.set_answer_floats(call.floats);
      return stub_->Gather(&call.context, request, &call.response);
    });
    EXPECT_TRUE(Eventually([&] { return WaitingRequests(*server_) == calls_.size(); }));
    return call;
  }

  void StartWithOneAtTheGate() {
    StartGated();
    first_ = GatherAtGate();
  }

  /// Lets the first go; the batches that wait stand at the gate then.
  void LetTheFirstGo() {
    first_->context.TryCancel();
    EXPECT_FALSE(first_->status.get().ok());
    EXPECT_TRUE(Eventually([&] { return gate_->gathers == 2; }));
  }

  void ExpectRight(Call& call) {
    const grpc::Status status = call.status.get();
    ASSERT_TRUE(status.ok()) << status.error_message();
    const GatherResult expected = Expected(photons_, call.positions, call.options);
    EXPECT_EQ(Array<std::uint32_t>(call.response.counts()), expected.counts);
    EXPECT_EQ(Array<float>(call.response.radii()), expected.radii);
    EXPECT_EQ(Array<std::uint32_t>(call.response.neighbor_ids()), expected.neighbor_ids);
    EXPECT_EQ(Array<float>(call.response.neighbor_squared_distances()),
              expected.neighbor_squared_distances);
  }

  std::unique_ptr<PendingGather> first_;
  std::vector<std::unique_ptr<Call>> calls_;
};

TEST_F(ServiceTogetherTest, SmallBatchesThatWaitAreAnsweredInOneLaunch) {
  StartWithOneAtTheGate();
  const GatherOptions options{.k = 8, .radius = 0.3f, .outputs = kLists};
  for (std::size_t queries = 1; queries <= 8; ++queries) Send(queries, options);
  Send(3, {.k = 9, .radius = 0.3f, .outputs = kLists});
  Send(server::kFewQueries + 1, options);
  gate_->open = true;
  EXPECT_TRUE(first_->status.get().ok());
  for (auto& call : calls_) ExpectRight(*call);
  EXPECT_EQ(gate_->gathers, 4);  // the first, eight together, another k, and too many
  std::vector<int> batches;
  for (const std::string& line : EndAndReadLog()) {
    const auto json = nlohmann::json::parse(line);
    if (json["method"] == "Gather" && json.contains("launch_batches")) {
      EXPECT_GT(json["device_us"].get<double>(), 0) << line;
      EXPECT_LE(json["device_us"].get<double>(), json["total_us"].get<double>()) << line;
      EXPECT_NE(json.value("search", ""), "") << line;
      batches.push_back(json["launch_batches"]);
    }
  }
  EXPECT_EQ(batches.size(), 8u);
  EXPECT_THAT(batches, Each(8));
}

TEST_F(ServiceTogetherTest, EachIsAnsweredInTheFormatThatItAsksFor) {
  StartWithOneAtTheGate();
  const GatherOptions options{.k = 8, .radius = 0.3f, .outputs = kLists};
  Call& floats = Send(3, options);
  Call& halves = Send(3, options, std::chrono::minutes(1), v1::FLOAT_FORMAT_HALF);
  gate_->open = true;
  EXPECT_TRUE(first_->status.get().ok());
  ExpectRight(floats);
  EXPECT_FALSE(floats.response.approximate());
  ASSERT_TRUE(halves.status.get().ok());
  EXPECT_EQ(gate_->gathers, 2);  // the first, and these together
  const GatherResult expected = Expected(photons_, halves.positions, options);
  EXPECT_EQ(Array<std::uint32_t>(halves.response.neighbor_ids()), expected.neighbor_ids);
  std::vector<float> radii;
  AppendFromHalves(Array<std::uint16_t>(halves.response.radii()),
                   halves.response.wire_report().radius_scale(), radii);
  ASSERT_EQ(radii.size(), expected.radii.size());
  for (std::size_t i = 0; i < radii.size(); ++i) {
    EXPECT_NEAR(radii[i], expected.radii[i], kHalfError * expected.radii[i]);
  }
  EXPECT_TRUE(halves.response.approximate());
}

TEST_F(ServiceTogetherTest, OneThatIsCancelledDoesNotStopTheOthers) {
  StartWithOneAtTheGate();
  const GatherOptions options{.k = 8, .outputs = kLists};
  Call& cancelled = Send(2, options);
  Call& late = Send(2, options, 300ms);
  Call& wanted = Send(3, options);
  LetTheFirstGo();
  cancelled.context.TryCancel();
  EXPECT_EQ(cancelled.status.get().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(late.status.get().error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  EXPECT_EQ(gate_->stopped, 1);  // the first
  gate_->open = true;
  ExpectRight(wanted);
  EXPECT_EQ(gate_->gathers, 2);
  std::map<std::string, int> codes;
  for (const std::string& line : EndAndReadLog()) {
    const auto json = nlohmann::json::parse(line);
    if (json["method"] == "Gather" && json.contains("launch_batches")) {
      ++codes[json["code"].get<std::string>()];
    }
  }
  EXPECT_EQ(codes,
            (std::map<std::string, int>{{"CANCELLED", 1}, {"DEADLINE_EXCEEDED", 1}, {"OK", 1}}));
}

TEST_F(ServiceTogetherTest, ALaunchThatNobodyWaitsForStops) {
  StartWithOneAtTheGate();
  for (int i = 0; i < 3; ++i) Send(2, {.k = 8});
  LetTheFirstGo();
  for (auto& call : calls_) call->context.TryCancel();
  for (auto& call : calls_) {
    EXPECT_EQ(call->status.get().error_code(), grpc::StatusCode::CANCELLED);
  }
  // The device is free again although the gate is shut.
  EXPECT_TRUE(Eventually([&] { return gate_->stopped >= 2; }));
  const int begun = gate_->gathers;
  gate_->open = true;
  grpc::ClientContext context;
  v1::GatherResponse response;
  EXPECT_TRUE(Gather(context, response).ok());
  EXPECT_GE(gate_->gathers, begun);
}

TEST_F(ServiceTogetherTest, BatchesOfAStreamAreAnsweredInTheirOrder) {
  StartGated();
  std::vector<v1::GatherRequest> batches;
  for (std::uint32_t i = 0; i < 20; ++i) {
    batches.push_back(MakeBatch("cloud", MakePoints(1 + i % 8, i), {.k = 8, .outputs = kLists}));
    batches.back().set_batch_id(i);
  }
  std::vector<std::future<std::vector<v1::GatherResponse>>> streams;
  for (int i = 0; i < 4; ++i) {
    streams.push_back(std::async(std::launch::async, [&] {
      std::vector<v1::GatherResponse> parts;
      EXPECT_TRUE(Stream(*stub_, batches, parts).ok());
      return parts;
    }));
  }
  for (auto& stream : streams) {
    const auto parts = stream.get();
    ASSERT_EQ(parts.size(), 20u);
    for (std::uint32_t i = 0; i < 20; ++i) {
      EXPECT_EQ(parts[i].batch_id(), i);
      EXPECT_EQ(
          Array<std::uint32_t>(parts[i].neighbor_ids()),
          Expected(photons_, MakePoints(1 + i % 8, i), {.k = 8, .outputs = kLists}).neighbor_ids);
    }
  }
}

/// Fails where more than `most` queries come at once.
class NarrowGatherer : public ForwardingGatherer {
 public:
  NarrowGatherer(std::unique_ptr<Gatherer> map, std::size_t most, std::shared_ptr<Gate> gate)
      : ForwardingGatherer(std::move(map)), most_(most), gate_(std::move(gate)) {}
  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override {
    ++gate_->gathers;
    if (auto status = gate_->Pass(cancelled); !status.ok()) return status;
    if (queries.size() > most_) return absl::ResourceExhaustedError("too many queries at once");
    return ForwardingGatherer::Gather(queries, options, cancelled);
  }

 private:
  const std::size_t most_;
  const std::shared_ptr<Gate> gate_;
};

class NarrowBuilder : public Builder {
 public:
  explicit NarrowBuilder(std::shared_ptr<Gate> gate) : gate_(std::move(gate)) {}
  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck&) override {
    auto map = MakeBruteForceBuilder()->Build(photons, options);
    if (!map.ok()) return map.status();
    return std::make_unique<NarrowGatherer>(*std::move(map), 2, gate_);
  }

 private:
  const std::shared_ptr<Gate> gate_;
};

TEST_F(ServiceTogetherTest, WhatFailsTogetherIsTriedAlone) {
  Start(std::make_unique<NarrowBuilder>(gate_));
  MustBuild("cloud", photons_);
  first_ = GatherAtGate();
  const GatherOptions options{.k = 8, .outputs = kLists};
  Call& a = Send(2, options);
  Call& b = Send(1, options);
  Call& large = Send(3, options);
  gate_->open = true;
  EXPECT_TRUE(first_->status.get().ok());
  ExpectRight(a);
  ExpectRight(b);
  EXPECT_EQ(large.status.get().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
}

class GatherTogetherTest : public ::testing::TestWithParam<std::string> {};

TEST_P(GatherTogetherTest, EachPartHasTheBitsOfABatchAlone) {
  const auto builder = MakeDeviceBuilder({.device = GetParam(), .cache_directory = {}});
  ASSERT_TRUE(builder.ok()) << builder.status();
  const auto map = (*builder)->Build(MakePhotons(20'000, 3), {});
  ASSERT_TRUE(map.ok()) << map.status();
  const std::vector<float> points = MakePoints(40, 5), normals = MakePoints(40, 6);
  std::vector<float> radii(40);
  for (std::size_t i = 0; i < radii.size(); ++i) radii[i] = 0.01f * static_cast<float>(i);
  constexpr float kUnlimited = std::numeric_limits<float>::infinity();
  for (const bool own_radii : {false, true}) {
    for (const GatherOptions& options :
         {GatherOptions{.k = 8, .radius = kUnlimited, .outputs = kLists | kOutputDensity},
          GatherOptions{.k = 50, .radius = 0.1f, .outputs = kLists | kOutputDensity},
          GatherOptions{.k = 8, .radius = 0.1f, .outputs = kOutputCount | kOutputStatistics},
          GatherOptions{.k = 0, .radius = 0.1f, .outputs = kOutputCount | kOutputDensity}}) {
      std::vector<GatherQueries> batches;
      for (std::size_t first = 0, count = 1; first + count <= 40; first += count++) {
        batches.push_back({.positions = std::span(points).subspan(3 * first, 3 * count),
                           .normals = own_radii ? std::span(normals).subspan(3 * first, 3 * count)
                                                : std::span<const float>(),
                           .radii = own_radii ? std::span(radii).subspan(first, count)
                                              : std::span<const float>()});
      }
      const auto parts = server::GatherTogether(**map, batches, options);
      ASSERT_TRUE(parts.ok()) << parts.status();
      ASSERT_EQ(parts->size(), batches.size());
      for (std::size_t i = 0; i < batches.size(); ++i) {
        const auto alone = (*map)->Gather(batches[i], options);
        ASSERT_TRUE(alone.ok()) << alone.status();
        const GatherResult& part = (*parts)[i];
        EXPECT_EQ(part.counts, alone->counts);
        EXPECT_EQ(part.radii, alone->radii);
        EXPECT_EQ(part.neighbor_ids, alone->neighbor_ids);
        EXPECT_EQ(part.neighbor_squared_distances, alone->neighbor_squared_distances);
        EXPECT_EQ(part.densities, alone->densities);
        EXPECT_EQ(part.nodes_visited, alone->nodes_visited);
        EXPECT_EQ(part.distance_tests, alone->distance_tests);
      }
    }
  }
}

std::vector<std::string> Devices() {
  std::vector<std::string> devices;
  for (const DeviceInfo& device : ListDevices()) devices.push_back(std::to_string(device.index));
  return devices;
}

INSTANTIATE_TEST_SUITE_P(Devices, GatherTogetherTest, ::testing::ValuesIn(Devices()),
                         [](const auto& device) { return "Device" + device.param; });

TEST(GatherTogetherTest, BatchesThatAskForOthersGoAlone) {
  const auto map = MakeBruteForceBuilder()->Build(MakePhotons(10, 1), {});
  ASSERT_TRUE(map.ok());
  const std::vector<float> points = MakePoints(65, 1);
  const GatherQueries few{.positions = std::span(points).first(3 * 64)}, many{.positions = points},
      with_radii{.positions = std::span(points).first(3), .radii = std::span(points).first(1)};
  const auto key = [&](const GatherQueries& queries, const GatherOptions& options) {
    return server::TogetherKey(**map, queries, options);
  };
  const GatherOptions options{.k = 8, .radius = 0.1f};
  EXPECT_EQ(key(few, options), key({.positions = few.positions.first(3)}, options));
  EXPECT_NE(key(few, options), "");
  EXPECT_EQ(key(many, options), "");
  EXPECT_EQ(key(few, {.k = 0, .radius = 0.1f, .outputs = kOutputNeighbors}), "");
  EXPECT_EQ(key(few, {.k = 8, .approximation = {.epsilon = 0.1f}}), "");
  for (const GatherOptions& other :
       {GatherOptions{.k = 9, .radius = 0.1f}, GatherOptions{.k = 8, .radius = 0.1000001f},
        GatherOptions{.k = 8, .radius = 0.1f, .outputs = kOutputRadius},
        GatherOptions{.k = 8, .radius = 0.1f, .kernel = DensityKernel::kCone}}) {
    EXPECT_NE(key(few, other), key(few, options));
  }
  EXPECT_NE(key(with_radii, options), key(few, options));
}

}  // namespace
}  // namespace treelight::testing
