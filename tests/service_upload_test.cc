#include <algorithm>
#include <future>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "fmt/format.h"
#include "grpcpp/create_channel.h"
#include "grpcpp/generic/generic_stub.h"
#include "grpcpp/security/credentials.h"
#include "tests/admission_fixture.h"

// Uploads, whose next message is read while one is taken up: whatever ends them, at whatever stage,
// the error is that of the first message that is wrong (but for one behind it that gRPC itself
// refuses), nothing is held any more, and no photon has got into the map of another.
namespace treelight::testing {
namespace {

/// The photons that builds were made from.
struct Built {
  std::mutex mutex;
  std::vector<Photons> photons;  // guarded by mutex
};

/// Brute force that keeps what it was given.
class KeepingBuilder final : public Builder {
 public:
  explicit KeepingBuilder(std::shared_ptr<Built> built) : built_(std::move(built)) {}

  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck&) override {
    {
      const std::lock_guard lock(built_->mutex);
      built_->photons.push_back(photons);
    }
    return MakeBruteForceBuilder()->Build(photons, options);
  }

 private:
  const std::shared_ptr<Built> built_;
};

/// A BuildPhotonMap call of messages that need not be any.
class RawUpload {
 public:
  explicit RawUpload(const std::shared_ptr<grpc::Channel>& channel) : stub_(channel) {
    call_ = stub_.PrepareCall(&context_, "/treelight.v1.PhotonMapService/BuildPhotonMap", &queue_);
    call_->StartCall(nullptr);
    Wait();
  }
  ~RawUpload() {
    context_.TryCancel();
    queue_.Shutdown();
    void* tag;
    bool ok;
    while (queue_.Next(&tag, &ok)) {
    }
  }

  /// Sends `messages` as far as the server takes them; how the call ends.
  grpc::Status Finish(const std::vector<std::string>& messages) {
    for (const std::string& message : messages) {
      const grpc::Slice slice(message);
      call_->Write(grpc::ByteBuffer(&slice, 1), nullptr);
      if (!Wait()) break;
    }
    call_->WritesDone(nullptr);
    Wait();
    grpc::ByteBuffer answer;
    do {
      call_->Read(&answer, nullptr);
    } while (Wait());
    grpc::Status status;
    call_->Finish(&status, nullptr);
    Wait();
    return status;
  }

 private:
  bool Wait() {
    void* tag;
    bool ok = false;
    return queue_.Next(&tag, &ok) && ok;
  }

  grpc::GenericStub stub_;
  grpc::ClientContext context_;
  grpc::CompletionQueue queue_;
  std::unique_ptr<grpc::GenericClientAsyncReaderWriter> call_;
};

/// Over a socket: without one gRPC's blocking client does not see that a call has ended early.
class ServiceUploadTest : public AdmissionTest {
 protected:
  void StartKeeping() {
    options_.build_slots = kSlots;
    options_.listen = "127.0.0.1:0";
    Start(std::make_unique<KeepingBuilder>(built_));
    channel_ = grpc::CreateChannel(server_->address(), grpc::InsecureChannelCredentials());
    stub_ = v1::PhotonMapService::NewStub(channel_);
  }

  /// Whether every slot and all memory is free again, and uploads go on.
  void ExpectAllFree() {
    EXPECT_TRUE(AllGivenBack());
    for (std::size_t i = 0; i < kSlots + 1; ++i) MustBuild("healthy", photons_);
  }

  static constexpr std::size_t kSlots = 12;
  const std::shared_ptr<Built> built_ = std::make_shared<Built>();
  std::shared_ptr<grpc::Channel> channel_;
};

TEST_F(ServiceUploadTest, ManyAtOnceGetTheirOwnPhotonsBitByBit) {
  StartKeeping();
  constexpr std::size_t kPhotons = 30000;
  const auto photons_of = [](std::size_t i) {
    return MakePhotons(kPhotons + i, static_cast<std::uint32_t>(i));
  };
  std::vector<std::future<void>> uploads;
  for (std::size_t i = 0; i < kSlots; ++i) {
    uploads.push_back(std::async(std::launch::async, [&, i] {
      // Chunks of all sizes, of which many are on their way at once.
      const auto messages = MakeUpload(fmt::format("map{}", i), photons_of(i), 17 + 371 * i);
      v1::BuildPhotonMapResponse built;
      const grpc::Status status = Build(*stub_, messages, built);
      EXPECT_TRUE(status.ok()) << status.error_message();
    }));
  }
  for (auto& upload : uploads) upload.get();
  const std::lock_guard lock(built_->mutex);
  ASSERT_EQ(built_->photons.size(), kSlots);
  std::ranges::sort(built_->photons, {}, &Photons::size);
  for (std::size_t i = 0; i < kSlots; ++i) {
    const Photons expected = photons_of(i), &photons = built_->photons[i];
    ASSERT_EQ(photons.size(), expected.size());
    EXPECT_TRUE(photons.positions == expected.positions) << i;
    EXPECT_TRUE(photons.powers == expected.powers) << i;
    EXPECT_TRUE(photons.directions == expected.directions) << i;
  }
}

TEST_F(ServiceUploadTest, TheFirstWrongChunkIsTheErrorWhateverFollows) {
  StartKeeping();
  const auto good = MakeUpload("map", photons_, 10);
  for (const std::size_t wrong :
       {std::size_t{1}, std::size_t{2}, good.size() / 2, good.size() - 1}) {
    auto messages = good;
    messages[wrong].mutable_chunk()->clear_powers();
    // A later one is wrong in another way.
    if (wrong + 1 < messages.size()) messages.back().mutable_chunk()->clear_positions();
    v1::BuildPhotonMapResponse built;
    const grpc::Status status = Build(*stub_, messages, built);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << wrong;
    EXPECT_EQ(status.error_message(),
              "chunk.powers: 0 bytes, expected 120 (12 bytes for each of 10 photons)")
        << wrong;
  }
  EXPECT_TRUE(built_->photons.empty());
  ExpectAllFree();
}

TEST_F(ServiceUploadTest, AStreamThatEndsEarlyOrGoesOnForTooLongBuildsNothing) {
  StartKeeping();
  const auto messages = MakeUpload("map", photons_, 100);
  v1::BuildPhotonMapResponse built;
  for (const std::size_t sent : {0u, 1u, 2u, 10u}) {
    const grpc::Status status = Build(*stub_, std::span(messages).first(sent), built);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
    EXPECT_EQ(
        status.error_message(),
        sent == 0
            ? "header: the stream is empty"
            : fmt::format("the stream ended after {} photons, header.photon_count announced 1000",
                          100 * (sent - 1)));
  }
  auto longer = messages;
  longer.push_back(messages[1]);
  EXPECT_EQ(Build(*stub_, longer, built).error_message(),
            "chunk.positions: 100 photons after 1000, header.photon_count announced 1000");
  longer.back() = messages[0];
  EXPECT_EQ(Build(*stub_, longer, built).error_message(),
            "header: a second one; only the first message is one");
  EXPECT_TRUE(built_->photons.empty());
  ExpectAllFree();
}

TEST_F(ServiceUploadTest, OneThatIsCancelledAtAnyStageIsOver) {
  StartKeeping();
  const auto messages = MakeUpload("map", photons_, 10);
  for (int round = 0; round < 5; ++round) {
    for (const std::size_t sent : {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{3},
                                   std::size_t{50}, messages.size()}) {
      grpc::ClientContext context;
      v1::BuildPhotonMapResponse built;
      const auto writer = stub_->BuildPhotonMap(&context, &built);
      for (std::size_t i = 0; i < sent; ++i) ASSERT_TRUE(writer->Write(messages[i]));
      context.TryCancel();
      EXPECT_EQ(writer->Finish().error_code(), grpc::StatusCode::CANCELLED) << sent;
    }
  }
  EXPECT_TRUE(built_->photons.empty());
  ExpectAllFree();
}

TEST_F(ServiceUploadTest, ARepeatThatStandsStillHoldsNoSlotAndNoMemory) {
  StartKeeping();
  auto messages = MakeUpload("map", photons_, 100);
  messages[0].mutable_header()->set_request_id("again");
  v1::BuildPhotonMapResponse built;
  ASSERT_TRUE(Build(*stub_, messages, built).ok());
  std::vector<std::unique_ptr<OpenUpload>> repeats;
  for (std::size_t i = 0; i < kSlots; ++i) {
    repeats.push_back(std::make_unique<OpenUpload>(*stub_, messages[0]));
  }
  EXPECT_TRUE(AllGivenBack());
  EXPECT_TRUE(
      Eventually([&] { return Build(*stub_, MakeUpload("healthy", photons_), built).ok(); }));
  for (const auto& repeat : repeats) {
    EXPECT_TRUE(repeat->Finish(std::span(messages).subspan(1, 3)).ok());
  }
  EXPECT_EQ(built_->photons.size(), 2u);
}

TEST_F(ServiceUploadTest, ChunksMayBeWrittenAsNobodyWritesThem) {
  StartKeeping();
  const auto messages = MakeUpload("map", photons_, 100);
  std::vector<std::string> bytes;
  for (std::size_t i = 0; i < messages.size(); ++i) {
    bytes.push_back(messages[i].SerializeAsString());
    if (i == 0) continue;
    if (i % 3 == 0) bytes[i] += std::string("\x78\x01", 2);  // an unknown field
    if (i % 3 == 1)
      bytes[i] = messages[1].SerializeAsString() + bytes[i];  // the last of each array counts
  }
  const grpc::Status status = RawUpload(channel_).Finish(bytes);
  ASSERT_TRUE(status.ok()) << status.error_message();
  ASSERT_EQ(built_->photons.size(), 1u);
  EXPECT_TRUE(built_->photons[0].positions == photons_.positions);
  EXPECT_TRUE(built_->photons[0].powers == photons_.powers);
  EXPECT_TRUE(built_->photons[0].directions == photons_.directions);
}

TEST_F(ServiceUploadTest, WhatIsNoMessageIsRefusedWhereverItComes) {
  StartKeeping();
  const auto messages = MakeUpload("map", photons_, 100);
  std::vector<std::string> good;
  for (const auto& message : messages) good.push_back(message.SerializeAsString());
  for (const std::size_t place : {std::size_t{0}, std::size_t{1}, std::size_t{5}, good.size()}) {
    for (const auto& [bytes, error] :
         {std::pair<std::string, const char*>{"\x12\x7f", "message: not a BuildPhotonMapRequest"},
          {good[1].substr(0, 50), "message: not a BuildPhotonMapRequest"},
          {"", "message: neither header nor chunk"}}) {
      auto sent = good;
      sent.insert(sent.begin() + static_cast<std::ptrdiff_t>(place), bytes);
      const grpc::Status status = RawUpload(channel_).Finish(sent);
      EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << place;
      EXPECT_EQ(status.error_message(), error) << place;
    }
  }
  EXPECT_TRUE(built_->photons.empty());
  ExpectAllFree();
}

}  // namespace
}  // namespace treelight::testing
