// Queries as 16-bit offsets and answers as half floats, through the service.

#include <chrono>
#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "client/gather_wire.h"
#include "client/photon_map_client.h"
#include "core/model/half.h"
#include "core/model/quantize.h"
#include "gmock/gmock.h"
#include "nlohmann/json.hpp"
#include "tests/server_fixture.h"

namespace treelight::testing {
namespace {

using client::GatherAnswer;
using client::GatherPipeline;
using client::MakeGatherRequest;
using client::PhotonMapClient;
using client::WireOptions;
using ::testing::HasSubstr;

constexpr std::chrono::seconds kTimeout{60};  // a deadlock fails instead of hanging
constexpr std::size_t kQueries = 1009;
constexpr std::uint32_t kAll = kOutputCount | kOutputRadius | kOutputNeighbors | kOutputDensity;
const WireOptions kQuantized{.quantize_queries = true};
const WireOptions kHalves{.answer_floats = v1::FLOAT_FORMAT_HALF};
const WireOptions kBoth{.quantize_queries = true, .answer_floats = v1::FLOAT_FORMAT_HALF};

/// Numbers that came as halves of exact ones.
void ExpectHalves(const std::vector<float>& answer, const std::vector<float>& exact) {
  ASSERT_EQ(answer.size(), exact.size());
  double largest = 0;
  for (const float number : exact) {
    if (std::isfinite(number)) largest = std::max<double>(largest, std::fabs(number));
  }
  for (std::size_t i = 0; i < exact.size(); ++i) {
    if (std::isinf(exact[i])) {
      EXPECT_EQ(answer[i], exact[i]);
    } else {
      EXPECT_NEAR(answer[i], exact[i], kHalfError * std::fabs(exact[i]) + 0x1p-39 * largest) << i;
    }
  }
}

class ServiceWireTest : public ServerTest {
 protected:
  void StartServer(std::uint64_t part_bytes = 1 << 20) {
    options_.limits.max_part_bytes = part_bytes;
    Start(MakeCpuBuilder());
    client_ = std::make_unique<PhotonMapClient>(server_->InProcessChannel(), kTimeout);
    ASSERT_TRUE(client_->BuildPhotonMap("map", photons_).ok());
  }

  GatherAnswer Gather(const GatherQueries& queries, const GatherOptions& options,
                      const WireOptions& wire) {
    const auto answer = client_->Gather({.name = "map"}, queries, options, wire);
    EXPECT_TRUE(answer.ok()) << answer.status();
    return answer.ok() ? *answer : GatherAnswer();
  }

  /// Where the server gathers what is quantised.
  static std::vector<float> Moved(const std::vector<float>& positions) {
    const QuantizedPositions quantized = Quantize(positions);
    std::vector<float> moved;
    AppendPositions(quantized.box, quantized.offsets, moved);
    return moved;
  }

  grpc::Status Ask(const v1::GatherRequest& request, v1::GatherResponse& response) {
    grpc::ClientContext context;
    return stub_->Gather(&context, request, &response);
  }

  const std::uint32_t seed_ = std::random_device{}();
  const Photons photons_ = MakePhotons(5003, seed_);
  const std::vector<float> positions_ = MakePoints(kQueries, seed_ + 1);
  std::unique_ptr<PhotonMapClient> client_;
};

TEST_F(ServiceWireTest, QuantizedQueriesAreGatheredWhereTheirOffsetsSay) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  StartServer();
  const GatherOptions options{.k = 20, .outputs = kAll};
  const GatherAnswer answer = Gather({.positions = positions_}, options, kQuantized);
  const GatherResult moved = Expected(photons_, Moved(positions_), options);
  EXPECT_EQ(answer.result.neighbor_ids, moved.neighbor_ids);
  EXPECT_EQ(answer.result.neighbor_squared_distances, moved.neighbor_squared_distances);
  EXPECT_EQ(answer.result.radii, moved.radii);
  // The k-th distance changes by no more than the query moves.
  EXPECT_GT(answer.wire.largest_move, 0);
  EXPECT_LT(answer.wire.largest_move, 1.5e-5f);
  EXPECT_EQ(answer.wire.relative_error, 0);
  const GatherResult exact = Expected(photons_, positions_, options);
  double changed = 0;
  for (std::size_t i = 0; i < kQueries; ++i) {
    EXPECT_NEAR(answer.result.radii[i], exact.radii[i], answer.wire.largest_move + 1e-7);
    changed += answer.result.radii[i] != exact.radii[i] ? 1 : 0;
  }
  EXPECT_GT(changed, kQueries / 2);
  // Half the bytes, and what goes with every message.
  const GatherAnswer as_floats = Gather({.positions = positions_}, options, {});
  EXPECT_LE(answer.wire.request_bytes, 6 * kQueries + 100);
  EXPECT_GE(as_floats.wire.request_bytes, 12 * kQueries);
  EXPECT_EQ(as_floats.wire.largest_move, 0);
}

TEST_F(ServiceWireTest, NormalsAndRadiiGoWithThem) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  StartServer();
  std::vector<float> normals, radii;
  std::mt19937 random(seed_ + 2);
  std::normal_distribution<float> normal;
  for (std::size_t i = 0; i < kQueries; ++i) {
    for (int c = 0; c < 3; ++c) normals.push_back(100 * normal(random));  // of any length
    radii.push_back(0.05f + 0.1f * std::fabs(normal(random)));
  }
  const GatherQueries queries{.positions = positions_, .normals = normals, .radii = radii};
  const GatherOptions options{.k = 0, .outputs = kOutputRadius | kOutputDensity};
  const GatherAnswer exact = Gather(queries, options, {});
  const GatherAnswer answer = Gather(queries, options, kQuantized);
  EXPECT_EQ(answer.result.radii, radii);
  EXPECT_LE(answer.wire.request_bytes, (6 + 4 + 4) * kQueries + 100);
  // Few photons are so near the edge of a radius or of a hemisphere that they change sides.
  std::size_t close = 0;
  for (std::size_t i = 0; i < exact.result.densities.size(); ++i) {
    const double should_be = exact.result.densities[i];
    close += std::fabs(answer.result.densities[i] - should_be) <= 0.02 * should_be ? 1 : 0;
  }
  EXPECT_GT(close, exact.result.densities.size() * 98 / 100);
}

TEST_F(ServiceWireTest, HalvesAreTheAnswerRounded) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  StartServer();
  // A radius that not all queries find k photons in: ids and squared distances are padded.
  const GatherOptions options{.k = 20, .radius = 0.1f, .outputs = kAll};
  const GatherAnswer exact = Gather({.positions = positions_}, options, {});
  const GatherAnswer answer = Gather({.positions = positions_}, options, kHalves);
  EXPECT_EQ(answer.result.counts, exact.result.counts);
  EXPECT_EQ(answer.result.neighbor_ids, exact.result.neighbor_ids);
  ExpectHalves(answer.result.radii, exact.result.radii);
  ExpectHalves(answer.result.neighbor_squared_distances, exact.result.neighbor_squared_distances);
  ExpectHalves(answer.result.densities, exact.result.densities);
  EXPECT_NE(answer.result.densities, exact.result.densities);
  EXPECT_EQ(answer.wire.relative_error, kHalfError);
  EXPECT_EQ(answer.wire.largest_move, 0);
  // 4 for the count and the ids, 2 for all else.
  EXPECT_LE(answer.wire.answer_bytes, (4 + 2 + 20 * (4 + 2) + 3 * 2) * kQueries + 200);
  EXPECT_GE(exact.wire.answer_bytes, (4 + 4 + 20 * 8 + 12) * kQueries);
}

TEST_F(ServiceWireTest, PartsOfAStreamHaveScalesOfTheirOwn) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  StartServer(/*part_bytes=*/2000);
  // Far from the photons distances are 2^20 times those among them.
  std::vector<float> positions = positions_;
  for (std::size_t i = positions.size() / 2; i < positions.size(); ++i) positions[i] += 1e6f;
  const GatherOptions options{.k = 5, .outputs = kOutputRadius | kOutputNeighbors};
  std::vector<v1::GatherResponse> parts;
  const auto request =
      MakeGatherRequest({.name = "map"}, 3, {.positions = positions}, options, kHalves);
  ASSERT_TRUE(Stream(*stub_, std::vector{request}, parts).ok());
  ASSERT_GT(parts.size(), 10u);
  client::AnswerAssembly assembly(request);
  for (const v1::GatherResponse& part : parts) {
    EXPECT_TRUE(part.approximate());
    EXPECT_EQ(part.wire_report().density_scale(), 0);
    ASSERT_TRUE(assembly.Add(part).ok());
  }
  EXPECT_LT(1e4 * parts.front().wire_report().radius_scale(),
            parts.back().wire_report().radius_scale());
  const GatherResult exact = Expected(photons_, positions, options);
  const GatherAnswer answer = assembly.Take();
  EXPECT_EQ(answer.result.neighbor_ids, exact.neighbor_ids);
  ExpectHalves(answer.result.radii, exact.radii);
}

TEST_F(ServiceWireTest, UncappedListsAndPipelinesTravelSo) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  StartServer(/*part_bytes=*/5000);
  const GatherOptions options{.k = 0, .radius = 0.1f, .outputs = kOutputNeighbors};
  const GatherResult moved = Expected(photons_, Moved(positions_), options);
  const GatherAnswer answer = Gather({.positions = positions_}, options, kBoth);
  EXPECT_EQ(answer.result.neighbor_ids, moved.neighbor_ids);
  EXPECT_EQ(answer.result.neighbor_offsets, moved.neighbor_offsets);
  ExpectHalves(answer.result.neighbor_squared_distances, moved.neighbor_squared_distances);
  GatherPipeline pipeline(*client_, {.name = "map"}, options, kBoth);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(pipeline.Send({.positions = positions_}).ok());
  for (int i = 0; i < 3; ++i) {
    const auto received = pipeline.Receive();
    ASSERT_TRUE(received.ok()) << received.status();
    EXPECT_EQ(received->result.neighbor_ids, moved.neighbor_ids);
  }
}

TEST_F(ServiceWireTest, FewerPhotonsAreGatheredSoToo) {
  SCOPED_TRACE("seed " + std::to_string(seed_));
  StartServer(/*part_bytes=*/1500);
  const GatherOptions options{
      .k = 300, .outputs = kOutputDensity, .approximation = {.merged_photons = 8}};
  const GatherAnswer as_floats = Gather({.positions = positions_}, options, {});
  ASSERT_EQ(as_floats.merge_report.merged_photons(), 8u);
  const GatherAnswer answer = Gather({.positions = positions_}, options, kBoth);
  EXPECT_EQ(answer.merge_report.merged_photons(), 8u);
  EXPECT_GT(answer.errors.inexact_count, kQueries / 2);
  for (std::size_t i = 0; i < answer.result.densities.size(); ++i) {
    EXPECT_NEAR(answer.result.densities[i], as_floats.result.densities[i],
                0.05 * as_floats.result.densities[i]);
  }
}

TEST_F(ServiceWireTest, WhatIsMovedOrRoundedSaysSoAndIsLogged) {
  StartServer();
  const GatherOptions options{.k = 5, .outputs = kOutputCount};
  v1::GatherResponse response;
  const auto ask = [&](const GatherOptions& o, const WireOptions& wire,
                       const std::vector<float>& positions) {
    const auto request = MakeGatherRequest({.name = "map"}, 0, {.positions = positions}, o, wire);
    EXPECT_TRUE(Ask(request, response).ok());
    return request.ByteSizeLong();
  };
  ask(options, {}, positions_);
  EXPECT_FALSE(response.approximate() || response.has_wire_report());
  ask(options, kHalves, positions_);  // counts are as they were
  EXPECT_FALSE(response.approximate() || response.has_wire_report());
  ask(options, kQuantized, {0.25f, 0.5f, 0.5f});  // one place is not moved
  EXPECT_FALSE(response.approximate());
  const GatherOptions radii{.k = 5, .outputs = kOutputRadius};
  const std::size_t sent = ask(radii, kBoth, positions_);
  EXPECT_TRUE(response.approximate());
  EXPECT_GT(response.wire_report().largest_move(), 0);
  EXPECT_EQ(response.wire_report().relative_error(), 0x1p-11f);
  EXPECT_EQ(response.inexact_count(), 0u);  // of Approximation: none was asked for
  EXPECT_EQ(response.radii().size(), 2 * kQueries);
  const std::size_t received = response.ByteSizeLong();
  nlohmann::json last;
  for (const std::string& line : EndAndReadLog()) {
    const auto json = nlohmann::json::parse(line);
    if (json["method"] == "Gather") last = json;
  }
  EXPECT_EQ(last["quantized"], true);
  EXPECT_EQ(last["answer_floats"], "FLOAT_FORMAT_HALF");
  EXPECT_EQ(last["queries"], kQueries);
  EXPECT_EQ(last["bytes_in"], sent);
  EXPECT_EQ(last["bytes_out"], received);
}

TEST_F(ServiceWireTest, WhatIsWrongIsRefusedAndNamesTheField) {
  options_.limits.max_queries = 10;
  StartServer();
  const auto refused = [&](auto change) {
    auto request = MakeGatherRequest({.name = "map"}, 0, {.positions = MakePoints(3, 1)},
                                     {.k = 5, .outputs = kOutputCount}, kQuantized);
    change(request, *request.mutable_quantized());
    v1::GatherResponse response;
    return Ask(request, response).error_message();
  };
  using Request = v1::GatherRequest;
  using Quantized = v1::QuantizedQueries;
  EXPECT_EQ(refused([](Request&, Quantized&) {}), "");
  EXPECT_EQ(refused([](Request& r, Quantized&) { r.set_positions(std::string(36, '\0')); }),
            "positions: 36 bytes beside quantized, which has the queries; leave positions out, or "
            "quantized");
  EXPECT_THAT(refused([](Request& r, Quantized&) { r.set_normals(std::string(36, '\0')); }),
              HasSubstr("normals: 36 bytes beside quantized"));
  EXPECT_EQ(refused([](Request&, Quantized& q) { q.set_positions(std::string(17, '\0')); }),
            "quantized.positions: 17 bytes are no multiple of 6, three uint16");
  EXPECT_EQ(refused([](Request&, Quantized& q) { q.clear_positions(); }),
            "quantized.positions: 0 queries, a batch holds at least 1");
  EXPECT_THAT(refused([](Request&, Quantized& q) { q.set_positions(std::string(66, '\0')); }),
              HasSubstr("quantized.positions: 11 queries, the limit of a batch is 10"));
  EXPECT_EQ(refused([](Request&, Quantized& q) { q.set_normals(std::string(11, '\0')); }),
            "quantized.normals: 11 bytes, expected 12 (4 bytes for each of 3 queries) or none");
  EXPECT_EQ(refused([](Request& r, Quantized&) { r.set_radii(std::string(8, '\0')); }),
            "radii: 8 bytes, expected 12 (4 bytes for each of 3 queries) or none");
  EXPECT_EQ(refused([](Request&, Quantized& q) { q.set_box("box"); }),
            "quantized.box: 3 bytes, expected 24, six float32");
  const auto with_box = [&](std::vector<float> box) {
    return refused([&](Request&, Quantized& q) { q.set_box(Bytes(box)); });
  };
  EXPECT_EQ(with_box({0, 0, 0, 1, INFINITY, 1}),
            "quantized.box[4] is inf, it must be finite and within 1e+18");
  EXPECT_THAT(with_box({NAN, 0, 0, 1, 1, 1}), HasSubstr("quantized.box[0] is nan"));
  EXPECT_EQ(with_box({0, 2, 0, 1, 1, 1}),
            "quantized.box: the smallest y is 2, above the largest, 1");
  EXPECT_EQ(
      refused([](Request& r, Quantized&) { r.set_answer_floats(static_cast<v1::FloatFormat>(7)); }),
      "answer_floats is 7, no such format");
}

TEST_F(ServiceWireTest, TheClientRefusesWhatCannotBeQuantized) {
  StartServer();
  const auto refused = [&](const GatherQueries& queries) {
    return client_->Gather({.name = "map"}, queries, {.k = 5}, kQuantized).status().ToString();
  };
  const std::vector<float> positions(6), far = {0, 0, 0, 0, 2e18f, 0};
  const std::vector<float> normals = {0, 0, 1, 0, 0, 0};
  EXPECT_EQ(refused({.positions = far}),
            "INVALID_ARGUMENT: positions[4] of query 1 is 2e+18, to be quantised it must be finite "
            "and within 1e+18");
  EXPECT_EQ(refused({.positions = positions, .normals = normals}),
            "INVALID_ARGUMENT: normals of query 1 are 0, 0, 0, to be quantised they must be a "
            "direction");
}

}  // namespace
}  // namespace treelight::testing
