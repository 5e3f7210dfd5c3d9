#include <cmath>

#include "tests/server_fixture.h"

// Each error of an RPC with its code and message, and that the server is as it was before.
namespace treelight::testing {
namespace {

class ServiceErrorsTest : public ServerTest {
 protected:
  ServiceErrorsTest() {
    options_.limits.max_queries = 20'000;
    options_.limits.max_neighbors = 100'000;
    Start();
    Photons bare = MakePhotons(100, 1);
    bare.powers.clear();
    bare.directions.clear();
    MustBuild("bare", bare);
    before_ = State();
  }

  /// After every test: the bad calls have left no trace.
  void TearDown() override {
    EXPECT_EQ(State(), before_);
    v1::GatherResponse response;
    grpc::ClientContext context;
    EXPECT_TRUE(stub_->Gather(&context, MakeBatch("bare", {0, 0, 0}, {.k = 1}), &response).ok());
  }

  std::string State() {
    v1::ListPhotonMapsResponse maps;
    grpc::ClientContext context;
    EXPECT_TRUE(stub_->ListPhotonMaps(&context, {}, &maps).ok());
    return maps.SerializeAsString();
  }

  /// "CODE: message" of a unary Gather, which a stream must repeat.
  std::string GatherError(const v1::GatherRequest& request) {
    v1::GatherResponse response;
    grpc::ClientContext context;
    const auto status = stub_->Gather(&context, request, &response);
    return Format(status);
  }

  std::string StreamError(const v1::GatherRequest& request) {
    std::vector<v1::GatherResponse> parts;
    return Format(Stream(*stub_, std::span(&request, 1), parts));
  }

  std::string BuildError(std::span<const v1::BuildPhotonMapRequest> messages) {
    v1::BuildPhotonMapResponse response;
    return Format(Build(*stub_, messages, response));
  }

  static std::string Format(const grpc::Status& status) {
    return absl::StatusCodeToString(static_cast<absl::StatusCode>(status.error_code())) + ": " +
           status.error_message();
  }

  std::string before_;
};

TEST_F(ServiceErrorsTest, ABadBatchNamesFieldIndexAndValue) {
  const v1::GatherRequest good = MakeBatch("bare", {0, 0, 0, 1, 1, 1}, {.k = 1});
  const auto check = [&](auto change, const std::string& expected) {
    v1::GatherRequest bad = good;
    change(bad);
    EXPECT_EQ(GatherError(bad), expected);
    EXPECT_EQ(StreamError(bad), expected);
  };
  check([](auto& r) { r.set_map("nosuch"); }, "NOT_FOUND: no map is named 'nosuch'");
  check([](auto& r) { r.set_version(9); }, "NOT_FOUND: map 'bare' has no version 9, only 1");
  check([](auto& r) { r.clear_map(); },
        "INVALID_ARGUMENT: map: 0 characters, it must have [1, 128]");
  check([](auto& r) { r.clear_positions(); },
        "INVALID_ARGUMENT: positions: 0 queries, a batch holds at least 1");
  check([](auto& r) { r.set_positions("12345678901"); },
        "INVALID_ARGUMENT: positions: 11 bytes are no multiple of 12, three float32");
  check(
      [](auto& r) {
        r.set_positions(Bytes(std::vector<float>{0, 0, 0, 0, NAN, 0}));
      },
      "INVALID_ARGUMENT: positions[4] of query 1 is nan, it must be finite and within 1e+18");
  check(
      [](auto& r) {
        r.set_k(0);
        r.clear_radius();
      },
      "INVALID_ARGUMENT: k is 0 and radius is unlimited: give k > 0 or a finite radius");
  check([](auto& r) { r.set_radius(-1); }, "INVALID_ARGUMENT: radius is -1, it must be >= 0");
  check([](auto& r) { r.set_k(4097); }, "INVALID_ARGUMENT: k is 4097, at most 4096 is possible");
  check(
      [](auto& r) {
        r.set_radii(Bytes(std::vector<float>{1, NAN}));
      },
      "INVALID_ARGUMENT: radii[1] is nan, it must be >= 0");
  check([](auto& r) { r.set_radii("1234"); },
        "INVALID_ARGUMENT: radii: 4 bytes, expected 8 (4 bytes for each of 2 queries) or none");
  check([](auto& r) { r.set_normals("1234"); },
        "INVALID_ARGUMENT: normals: 4 bytes, expected 24 (12 bytes for each of 2 queries) or none");
  check([](auto& r) { r.set_outputs(0); },
        "INVALID_ARGUMENT: outputs is 0, it must be a sum of known outputs and not 0");
  check([](auto& r) { r.set_outputs(65); },
        "INVALID_ARGUMENT: outputs is 65, it must be a sum of known outputs and not 0");
  check([](auto& r) { r.set_outputs(v1::OUTPUT_DENSITY); },
        "INVALID_ARGUMENT: outputs: DENSITY needs powers; the map has none");
  check([](auto& r) { r.set_kernel(static_cast<v1::DensityKernel>(9)); },
        "INVALID_ARGUMENT: kernel is 9, no such kernel");
  check([](auto& r) { r.set_positions(std::string(12 * 20'001, '\0')); },
        "RESOURCE_EXHAUSTED: positions: 20001 queries, the limit of a batch is 20000 "
        "(ServerLimits.max_queries); send several batches");
}

TEST_F(ServiceErrorsTest, AnAnswerThatMightNotFitAMessageIsRefusedInOneMessageOnly) {
  const auto large =
      MakeBatch("bare", MakePoints(9'000, 1), {.k = 60, .outputs = kOutputNeighbors});
  EXPECT_EQ(
      GatherError(large),
      "RESOURCE_EXHAUSTED: the answer may take 4321024 bytes (9000 queries, k 60), the limit of a "
      "message is 4194304; use GatherStream, or fewer queries");
}

TEST_F(ServiceErrorsTest, TooManyNeighborsInABatchAreRefused) {
  auto request = MakeBatch("bare", MakePoints(2'001, 1), {.k = 50, .outputs = kOutputNeighbors});
  const std::string tail =
      " neighbours, the limit is 100000 (max_neighbors); send fewer queries in a batch, or a "
      "smaller k or radius";
  EXPECT_EQ(StreamError(request),
            "RESOURCE_EXHAUSTED: the answer of the batch holds 100050" + tail);
  request.set_k(0);
  request.set_radius(100);  // every list holds all 100 photons
  EXPECT_EQ(StreamError(request),
            "RESOURCE_EXHAUSTED: the answer of the batch holds 200100" + tail);
}

TEST_F(ServiceErrorsTest, ABadUploadLeavesNoMap) {
  const Photons photons = MakePhotons(10, 1);
  const auto good = MakeUpload("map", photons, 4);
  using Messages = std::vector<v1::BuildPhotonMapRequest>;
  EXPECT_EQ(BuildError(Messages{}), "INVALID_ARGUMENT: header: the stream is empty");
  EXPECT_EQ(BuildError(Messages{good[1]}),
            "INVALID_ARGUMENT: chunk: before the header, which is the first message");
  EXPECT_EQ(BuildError(Messages{good[0], good[0]}),
            "INVALID_ARGUMENT: header: a second one; only the first message is one");
  EXPECT_EQ(BuildError(Messages(1)), "INVALID_ARGUMENT: message: neither header nor chunk");
  EXPECT_EQ(BuildError(Messages{good[0], good[1], good[2]}),
            "INVALID_ARGUMENT: the stream ended after 8 photons, header.photon_count announced 10");
  Messages bad = good;
  auto positions = Array<float>(bad[2].chunk().positions());
  positions[7] = NAN;
  bad[2].mutable_chunk()->set_positions(Bytes(positions));
  EXPECT_EQ(BuildError(bad),
            "INVALID_ARGUMENT: chunk.positions: number 1 of photon 6 is nan, it must be finite and "
            "within 1e+18");
  bad = good;
  bad[0].mutable_header()->set_photon_count(0);
  EXPECT_EQ(BuildError(bad),
            "INVALID_ARGUMENT: header.photon_count is 0, a map needs at least 1 photon");
}

TEST_F(ServiceErrorsTest, AHeaderOverTheLimitsIsRefusedBeforeItsChunksAreRead) {
  auto upload = MakeUpload("map", MakePhotons(10, 1));
  upload[0].mutable_header()->set_photon_count(200'000'000);
  grpc::ClientContext context;
  v1::BuildPhotonMapResponse response;
  const auto writer = stub_->BuildPhotonMap(&context, &response);
  ASSERT_TRUE(writer->Write(upload[0]));
  // Neither a chunk nor the end of the stream is sent.
  const auto status = writer->Finish();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(status.error_message().find("200000000"), std::string::npos) << status.error_message();
}

TEST_F(ServiceErrorsTest, AMessageOverTheLimitIsRefusedAndTheServerLives) {
  auto request = MakeBatch("bare", {0, 0, 0}, {.k = 1});
  request.set_normals(std::string((4 << 20) + 1, '\0'));
  const std::string expected = "RESOURCE_EXHAUSTED: ";
  EXPECT_EQ(GatherError(request).substr(0, expected.size()), expected);
  EXPECT_EQ(StreamError(request).substr(0, expected.size()), expected);
  auto upload = MakeUpload("map", MakePhotons(10, 1));
  upload[1].mutable_chunk()->set_positions(request.normals());
  EXPECT_EQ(BuildError(upload).substr(0, expected.size()), expected);
}

TEST_F(ServiceErrorsTest, ARequestThatOnlyNamesAMapIsSmall) {
  const auto error = [&](std::size_t length) {
    v1::GetPhotonMapRequest request;
    request.set_name(std::string(length, 'x'));
    grpc::ClientContext context;
    v1::PhotonMap map;
    return stub_->GetPhotonMap(&context, request, &map).error_message();
  };
  EXPECT_EQ(error(65'532), "name: 65532 characters, it must have [1, 128]");
  EXPECT_EQ(error(65'533), "the request has 65537 bytes, one of this method has 65536 at most");
}

TEST_F(ServiceErrorsTest, MapsThatAreNotThereAreNamed) {
  v1::GetPhotonMapRequest get;
  get.set_name("nosuch");
  v1::PhotonMap map;
  grpc::ClientContext get_context;
  EXPECT_EQ(Format(stub_->GetPhotonMap(&get_context, get, &map)),
            "NOT_FOUND: no map is named 'nosuch'");
  v1::DeletePhotonMapRequest remove;
  remove.set_name("bare");
  remove.set_version(2);
  v1::DeletePhotonMapResponse removed;
  grpc::ClientContext context;
  EXPECT_EQ(Format(stub_->DeletePhotonMap(&context, remove, &removed)),
            "NOT_FOUND: map 'bare' has no version 2, only 1");
}

}  // namespace
}  // namespace treelight::testing
