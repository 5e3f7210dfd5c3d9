#include <chrono>
#include <future>
#include <string>
#include <vector>

#include "tests/gated_service.h"

// RebuildPhotonMap: other trees from the photons that a map holds.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;

class ServiceRebuildTest : public GatedServiceTest {
 protected:
  v1::ServerInfo Info() {
    v1::ServerInfo info;
    grpc::ClientContext context;
    EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
    return info;
  }

  static v1::RebuildPhotonMapRequest Request(v1::BuilderKind builder) {
    v1::RebuildPhotonMapRequest request;
    request.set_name("cloud");
    request.mutable_options()->set_builder(builder);
    request.mutable_options()->set_max_leaf_size(8);
    return request;
  }

  grpc::Status Rebuild(const v1::RebuildPhotonMapRequest& request) {
    grpc::ClientContext context;
    return stub_->RebuildPhotonMap(&context, request, &response_);
  }

  v1::GatherResponse MustGather(std::uint64_t version, std::uint32_t outputs) {
    auto batch =
        MakeBatch("cloud", MakePoints(100, 3), {.k = 20, .radius = 0.3f, .outputs = outputs});
    batch.set_version(version);
    grpc::ClientContext context;
    v1::GatherResponse answer;
    const grpc::Status status = stub_->Gather(&context, batch, &answer);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return answer;
  }

  v1::BuildPhotonMapResponse response_;
};

TEST_F(ServiceRebuildTest, AnotherTreeGivesTheSameAnswers) {
  Start(MakeCpuBuilder());
  MustBuild("cloud", photons_);
  std::uint64_t newest = 1;
  for (int builder = v1::BUILDER_KIND_LBVH; builder <= v1::BUILDER_KIND_KARRAS; ++builder) {
    if (!v1::BuilderKind_IsValid(builder)) continue;
    ASSERT_TRUE(Rebuild(Request(static_cast<v1::BuilderKind>(builder))).ok());
    EXPECT_EQ(response_.map().name(), "cloud");
    EXPECT_EQ(response_.map().options().builder(), builder);
    EXPECT_EQ(response_.map().photon_count(), photons_.size());
    EXPECT_GT(response_.timings().total_us(), 0);
    const std::uint64_t version = response_.map().version();
    EXPECT_EQ(version, ++newest);
    const auto all = kOutputCount | kOutputRadius | kOutputNeighbors | kOutputDensity;
    const auto first = MustGather(1, all), other = MustGather(version, all);
    EXPECT_EQ(other.version(), version);
    EXPECT_EQ(first.neighbor_ids(), other.neighbor_ids());
    EXPECT_EQ(first.neighbor_squared_distances(), other.neighbor_squared_distances());
    EXPECT_EQ(first.densities(), other.densities());  // powers and directions came along
    if (builder != v1::BUILDER_KIND_LBVH) {
      EXPECT_NE(MustGather(2, kOutputStatistics).nodes_visited(),
                MustGather(version, kOutputStatistics).nodes_visited());
    }
  }
}

TEST_F(ServiceRebuildTest, UnderAnotherNameWithATimeToLive) {
  StartGated();
  auto request = Request(v1::BUILDER_KIND_LBVH);
  request.set_new_name("other");
  request.set_time_to_live_ms(60'000);
  ASSERT_TRUE(Rebuild(request).ok());
  EXPECT_EQ(response_.map().name(), "other");
  EXPECT_EQ(response_.map().version(), 1u);
  EXPECT_EQ(response_.map().expires_unix_ms() - response_.map().created_unix_ms(), 60'000);
  Delete("cloud");
  request.set_name("other");
  request.set_version(1);
  EXPECT_TRUE(Rebuild(request).ok());
  EXPECT_EQ(response_.map().version(), 2u);
}

TEST_F(ServiceRebuildTest, ErrorsNameTheFieldAndChangeNothing) {
  StartGated();
  const auto error = [&](auto change) {
    auto request = Request(v1::BUILDER_KIND_HYBRID);
    change(request);
    const grpc::Status status = Rebuild(request);
    return std::to_string(status.error_code()) + " " + status.error_message();
  };
  EXPECT_EQ(error([](auto& r) { r.clear_name(); }), "3 name: 0 characters, it must have [1, 128]");
  EXPECT_EQ(error([](auto& r) { r.set_name("none"); }), "5 no map is named 'none'");
  EXPECT_EQ(error([](auto& r) { r.set_version(7); }), "5 map 'cloud' has no version 7, only 1");
  EXPECT_EQ(error([](auto& r) { r.set_new_name("a b"); }),
            "3 new_name[1] is the byte 0x20, allowed are A-Z a-z 0-9 . _ -");
  EXPECT_EQ(error([](auto& r) { r.set_request_id("/"); }),
            "3 request_id[0] is the byte 0x2f, allowed are A-Z a-z 0-9 . _ -");
  EXPECT_EQ(error([](auto& r) { r.set_time_to_live_ms(2'592'000'001); }),
            "3 time_to_live_ms is 2592000001, at most 2592000000 (30 days) is possible");
  EXPECT_EQ(error([](auto& r) { r.mutable_options()->set_subtree_size(7); }),
            "3 options.subtree_size is 7, it must be in [8, 4096], or 0 for the default");
  grpc::ClientContext context;
  v1::ListPhotonMapsResponse maps;
  ASSERT_TRUE(stub_->ListPhotonMaps(&context, {}, &maps).ok());
  EXPECT_EQ(maps.maps_size(), 1);
  EXPECT_EQ(gate_->builds, 1);
}

TEST_F(ServiceRebuildTest, AMapDeletedWhileTheCallWaitsIsBuiltFrom) {
  StartGated();
  const auto gather = GatherAtGate();
  auto rebuild =
      std::async(std::launch::async, [&] { return Rebuild(Request(v1::BUILDER_KIND_LBVH)); });
  EXPECT_TRUE(Eventually([&] {
    grpc::ClientContext context;
    v1::ServerInfo info;
    return stub_->GetServerInfo(&context, {}, &info).ok() && info.memory_bytes_used() > 20'000;
  }));
  Delete("cloud");
  gate_->open = true;
  EXPECT_TRUE(gather->status.get().ok());
  EXPECT_TRUE(rebuild.get().ok());
  EXPECT_EQ(response_.map().version(), 2u);
}

TEST_F(ServiceRebuildTest, OneThatWaitsIsCancelledAndLeavesNothing) {
  StartGated();
  const auto gather = GatherAtGate();
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + 50ms);
  EXPECT_EQ(
      stub_->RebuildPhotonMap(&context, Request(v1::BUILDER_KIND_LBVH), &response_).error_code(),
      grpc::StatusCode::DEADLINE_EXCEEDED);
  gate_->open = true;
  EXPECT_TRUE(gather->status.get().ok());
  EXPECT_TRUE(Eventually([&] {
    const v1::ServerInfo info = Info();
    return info.memory_bytes_used() == 0 && info.map_count() == 1;
  }));
  EXPECT_EQ(gate_->builds, 1);
  EXPECT_EQ(LogOf("RebuildPhotonMap")["code"], "DEADLINE_EXCEEDED");
}

TEST_F(ServiceRebuildTest, ItTakesItsRoomAsABuildDoes) {
  options_.memory_limit = 12 << 20;
  StartGated();
  MustBuild("cloud", MakePhotons(80'000, 2));  // 2.2 MB
  // What the upload has held is given back a moment after its answer.
  ASSERT_TRUE(Eventually([&] { return Info().memory_bytes_used() == 0; }));
  const auto request =
      Request(v1::BUILDER_KIND_SWEEP);  // beside the photons, work space of the host
  const grpc::Status status = Rebuild(request);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(status.error_message().find("map 'cloud@2' has 80000 photons: "), 0u)
      << status.error_message();
  EXPECT_TRUE(Rebuild(Request(v1::BUILDER_KIND_LBVH)).ok());
}

TEST_F(ServiceRebuildTest, TheLogTellsTheSource) {
  StartGated();
  auto request = Request(v1::BUILDER_KIND_LBVH);
  request.set_new_name("other");
  request.set_request_id("r-1");
  ASSERT_TRUE(Rebuild(request).ok());
  const auto log = LogOf("RebuildPhotonMap");
  EXPECT_EQ(log["map"], "other");
  EXPECT_EQ(log["version"], 1);
  EXPECT_EQ(log["source"], "cloud@1");
  EXPECT_EQ(log["photons"], 1000);
  EXPECT_EQ(log["request_id"], "r-1");
  EXPECT_EQ(log["options"]["max_leaf_size"], 8);
  EXPECT_EQ(log["bytes_in"], request.ByteSizeLong());
  EXPECT_EQ(log["code"], "OK");
}

}  // namespace
}  // namespace treelight::testing
