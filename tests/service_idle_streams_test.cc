// Streams of gathers that nobody sends a batch to: each holds room for one.

#include <memory>
#include <thread>
#include <vector>

#include "gmock/gmock.h"
#include "tests/admission_fixture.h"
#include "tests/server_fixture.h"

namespace treelight::testing {
namespace {

using ::testing::HasSubstr;

class ServiceIdleStreamsTest : public ServerTest {
 protected:
  struct Open {
    grpc::ClientContext context;
    std::unique_ptr<grpc::ClientReaderWriter<v1::GatherRequest, v1::GatherResponse>> stream;
  };
  std::unique_ptr<Open> OpenStream() {
    auto open = std::make_unique<Open>();
    open->stream = stub_->GatherStream(&open->context);
    return open;
  }
  /// Whether a batch is answered.
  bool Answers(Open& open) {
    v1::GatherResponse response;
    return open.stream->Write(MakeBatch("map", points_, {.k = 3, .outputs = kOutputRadius})) &&
           open.stream->Read(&response) && response.last();
  }
  const std::vector<float> points_ = MakePoints(5, 1);
};

/// Memory and calls of which a quarter is three streams.
struct Limits {
  std::uint64_t memory_limit;
  std::size_t max_calls;
};
class ServiceIdleStreamsLimitTest : public ServiceIdleStreamsTest,
                                    public ::testing::WithParamInterface<Limits> {};

TEST_P(ServiceIdleStreamsLimitTest, OfTooManyThoseThatAreIdleForLongestEnd) {
  constexpr std::size_t kMost = 3, kIdle = 8;
  options_.memory_limit = GetParam().memory_limit;
  options_.max_calls = GetParam().max_calls;
  options_.stall = std::chrono::milliseconds(300);
  Start();
  MustBuild("map", MakePhotons(100, 1));
  std::vector<std::unique_ptr<Open>> streams;
  for (std::size_t i = 0; i < kIdle; ++i) {
    streams.push_back(OpenStream());
    EXPECT_TRUE(Answers(*streams.back())) << i;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));  // it is idle before the next is
  }
  for (std::size_t i = 0; i < kIdle - kMost; ++i) {
    v1::GatherResponse response;
    EXPECT_FALSE(streams[i]->stream->Read(&response));
    const auto status = streams[i]->stream->Finish();
    EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED) << i;
    EXPECT_THAT(status.error_message(), HasSubstr("stream: no batch for 300 ms"));
    EXPECT_EQ(ReadDetails(status).quota, "memory");
  }
  // Few stay as long as they like.
  std::this_thread::sleep_for(3 * options_.stall);
  for (std::size_t i = kIdle - kMost; i < kIdle; ++i) {
    EXPECT_TRUE(Answers(*streams[i])) << i;
    streams[i]->stream->WritesDone();
    EXPECT_TRUE(streams[i]->stream->Finish().ok()) << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Few, ServiceIdleStreamsLimitTest,
                         ::testing::Values(Limits{64 << 20, 1024}, Limits{1 << 30, 12}));

TEST_F(ServiceIdleStreamsTest, ThoseThatSendBatchesStay) {
  options_.memory_limit = 64 << 20;
  options_.stall = std::chrono::milliseconds(3000);
  Start();
  MustBuild("map", MakePhotons(100, 1));
  std::vector<std::unique_ptr<Open>> streams;
  for (int i = 0; i < 6; ++i) streams.push_back(OpenStream());
  const auto end = std::chrono::steady_clock::now() + 2 * options_.stall;
  while (std::chrono::steady_clock::now() < end) {
    for (const auto& open : streams) ASSERT_TRUE(Answers(*open));
  }
  for (const auto& open : streams) {
    open->stream->WritesDone();
    EXPECT_TRUE(open->stream->Finish().ok());
  }
}

}  // namespace
}  // namespace treelight::testing
