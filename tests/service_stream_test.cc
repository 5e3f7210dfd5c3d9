#include <thread>
#include <vector>

#include "tests/gated_service.h"

// GatherStream: reading ahead, parts, errors, the end.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;

using ServiceStreamTest = GatedServiceTest;

TEST_F(ServiceStreamTest, AStreamReadsOneBatchAheadAndNoMore) {
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
  // The second waits for the first; a third that was read would have been by then.
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

TEST_F(ServiceStreamTest, TheFirstErrorOfAStreamComesAfterTheAnswersBeforeIt) {
  StartGated();
  std::vector<v1::GatherRequest> batches(3, MakeBatch("cloud", {0, 0, 0}, {.k = 1}));
  batches[1].set_outputs(0);
  std::vector<v1::GatherResponse> parts;
  EXPECT_EQ(Stream(*stub_, batches, parts).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(parts.size(), 1u);
  EXPECT_EQ(LogOf("GatherStream")["code"], "INVALID_ARGUMENT");
}

TEST_F(ServiceStreamTest, ACancelledStreamStopsItsGathers) {
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

TEST_F(ServiceStreamTest, LargeAnswersComeInPartsWithTimesInTheLast) {
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

TEST_F(ServiceStreamTest, UncappedListsAgreeWithBruteForce) {
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

}  // namespace
}  // namespace treelight::testing
