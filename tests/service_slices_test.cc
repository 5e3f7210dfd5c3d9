#include <algorithm>
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "tests/admission_fixture.h"

// What answers hold of the memory: slices of streams, lists without a cap.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;

class ServiceSlicesTest : public AdmissionTest {
 protected:
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

TEST_F(ServiceSlicesTest, AnAnswerOverTheMemoryLimitIsRefusedAndGivenBack) {
  options_.memory_limit = 9 << 20;
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

TEST_F(ServiceSlicesTest, SlicesGrowAsTheyAreTaken) {
  StartGated();
  GatherLongAnswer();
  EXPECT_LT(gate_->gathers, 25);  // 7, of 1, 2, 4, 8 and 16 MiB, where each takes little time
}

TEST_F(ServiceSlicesTest, SlicesStaySmallWhereMemoryIsShort) {
  options_.memory_limit = 9 << 20;
  StartGated();
  GatherLongAnswer();
  EXPECT_GT(gate_->gathers, 25);  // 32, of 2 MiB
}

TEST_F(ServiceSlicesTest, ListsWithoutACapArePaidForByTheirLength) {
  options_.limits.max_neighbors = 1 << 20;  // 8 MiB while they are gathered
  options_.memory_limit = 13 << 20;
  StartGated();
  const auto batch =
      MakeBatch("cloud", MakePoints(500, 2), {.k = 0, .radius = 10, .outputs = kOutputNeighbors});
  std::vector<v1::GatherResponse> parts;
  const auto status = Stream(*stub_, {&batch, 1}, parts);  // 4 MB
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_TRUE(AllGivenBack());
}

TEST_F(ServiceSlicesTest, ListsThatMightNotFitAreRefusedAndThoseThatAreHereAreHeld) {
  options_.limits.max_neighbors = 1 << 20;
  options_.memory_limit = 12 << 20;  // not a byte for anything else but the stream
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
  options_.devices = {MakeCpu()};
  options_.memory_limit = 24 << 20;
  StartGated();
  const auto batch = MakeBatch("cloud", MakePoints(500, 2), lists);
  status = Stream(*stub_, {&batch, 1}, parts);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(ReadDetails(status).quota, "memory");

  options_.devices.clear();
  options_.memory_limit = 13 << 20;
  StartGated();
  grpc::ClientContext context;
  const auto stream = stub_->GatherStream(&context);
  ASSERT_TRUE(stream->Write(batch));
  ASSERT_TRUE(Eventually([&] { return gate_->gathers == 2; }));
  // Gathered and not read: what they are, no more what they might have been.
  EXPECT_TRUE(Eventually([&] { return Info().memory_bytes_used() < 12u << 20; }));
  EXPECT_GE(Info().memory_bytes_used(), 500 * 1000 * 8u);
  context.TryCancel();
  stream->Finish();
  EXPECT_TRUE(AllGivenBack());
}

TEST_F(ServiceSlicesTest, AStreamThatIsNotReadHoldsASliceOrTwo) {
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
    std::this_thread::sleep_for(10ms);  // it must not grow in half a second
  }
  // Two slices, the parts of each twice, two requests of 96 kB twice, and one on its way.
  EXPECT_LE(most, 2 * ((1u << 20) + (1u << 19)) + 4 * 100'000u + options_.limits.max_message_bytes);
  EXPECT_LE(gate_->gathers, 40);
  context.TryCancel();
  stream->Finish();
  EXPECT_TRUE(AllGivenBack());
}

TEST_F(ServiceSlicesTest, SlicesTogetherAreTheAnswer) {
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

}  // namespace
}  // namespace treelight::testing
