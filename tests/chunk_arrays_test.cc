#include "server/chunk_arrays.h"

#include <algorithm>
#include <random>
#include <string>
#include <utility>

#include "gtest/gtest.h"

namespace treelight::server {
namespace {

std::string Joined(const Pieces& pieces) {
  std::string all;
  for (const std::string_view piece : pieces) all += piece;
  return all;
}

/// `bytes` in pieces of `size`, every other one behind an empty one.
Pieces Split(std::string_view bytes, std::size_t size) {
  Pieces pieces;
  while (!bytes.empty()) {
    if (pieces.size() % 3 == 0) pieces.push_back({});
    pieces.push_back(bytes.substr(0, size));
    bytes.remove_prefix(std::min(size, bytes.size()));
  }
  return pieces;
}

v1::BuildPhotonMapRequest MakeChunk(std::size_t size) {
  v1::BuildPhotonMapRequest request;
  request.mutable_chunk()->set_positions(std::string(size, 'p').append("ositions"));
  request.mutable_chunk()->set_powers(std::string(size, '\x12'));
  request.mutable_chunk()->set_directions(std::string(1 + size / 3, '\x1a'));
  return request;
}

/// Whether FindArrays has found in `bytes`, however they are split, what protobuf finds there.
void ExpectFound(const std::string& bytes, const v1::PhotonChunk& chunk) {
  for (const std::size_t size :
       {std::size_t{1}, std::size_t{2}, std::size_t{7}, std::size_t{100}, bytes.size()}) {
    const auto arrays = FindArrays(Split(bytes, size));
    ASSERT_TRUE(arrays.has_value()) << size;
    EXPECT_EQ(Joined(arrays->positions), chunk.positions()) << size;
    EXPECT_EQ(Joined(arrays->powers), chunk.powers()) << size;
    EXPECT_EQ(Joined(arrays->directions), chunk.directions()) << size;
    EXPECT_EQ(Length(arrays->positions), chunk.positions().size()) << size;
  }
}

TEST(ChunkArraysTest, AreFoundWhereverTheMessageIsSplit) {
  for (const std::size_t size : {0u, 1u, 127u, 128u, 20000u, 300000u}) {
    const auto request = MakeChunk(size);
    ExpectFound(request.SerializeAsString(), request.chunk());
  }
  v1::BuildPhotonMapRequest positions_alone;
  positions_alone.mutable_chunk()->set_positions("xyz");
  ExpectFound(positions_alone.SerializeAsString(), positions_alone.chunk());
}

TEST(ChunkArraysTest, LieWhereTheMessageLies) {
  const auto request = MakeChunk(500);
  const std::string bytes = request.SerializeAsString();
  const auto arrays = FindArrays(Pieces{bytes});
  ASSERT_TRUE(arrays.has_value());
  ASSERT_EQ(arrays->positions.size(), 1u);
  EXPECT_GE(arrays->positions[0].data(), bytes.data());
  EXPECT_LE(arrays->positions[0].data() + 508, bytes.data() + bytes.size());
}

TEST(ChunkArraysTest, OfWhatIsWrittenOtherwiseThereAreNone) {
  using namespace std::string_literals;
  const std::string chunk = "\x0a\x03xyz"s;
  const std::pair<const char*, std::string> messages[] = {
      {"empty", ""},
      {"a header", "\x0a\x03\x0a\x01m"s},
      {"a header behind the chunk", "\x12\x05"s + chunk + "\x0a\x03\x0a\x01m"},
      {"two chunks", "\x12\x05"s + chunk + "\x12\x05" + chunk},
      {"an array twice", "\x12\x0a"s + chunk + chunk},
      {"an unknown field", "\x12\x07"s + chunk + "\x20\x01"s},
      {"an unknown field beside", "\x12\x05"s + chunk + "\x20\x01"s},
      {"a number instead of an array", "\x12\x02\x08\x03"s},
      {"a group", "\x13\x14"s},
      {"no length", "\x12"s},
      {"half a length", "\x12\x85"s},
      {"a length too large", "\x12\x06"s + chunk},
      {"a length too small", "\x12\x04"s + chunk},
      {"an array too long", "\x12\x05\x0a\x04xyz"s},
      {"an endless length", "\x12\xff\xff\xff\xff\xff\xff\xff\xff\xff\x01"s + chunk},
      {"a tag alone", "\x12\x01\x0a"s}};
  for (const auto& [what, bytes] : messages) {
    for (const std::size_t size : {1u, 3u, 100u}) {
      EXPECT_FALSE(FindArrays(Split(bytes, size)).has_value()) << what;
    }
  }
}

TEST(ChunkArraysTest, WhereBytesChangeProtobufFindsTheSame) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  std::mt19937 random(seed);
  const std::string whole = MakeChunk(20).SerializeAsString();
  int found = 0;
  for (std::size_t i = 0; i < 20000; ++i) {
    std::string bytes = whole.substr(0, i % 4 == 0 ? random() % whole.size() : whole.size());
    for (std::size_t change = 0; change < 1 + i % 3; ++change) {
      if (!bytes.empty()) bytes[random() % bytes.size()] = static_cast<char>(random());
    }
    const auto arrays = FindArrays(Split(bytes, 1 + random() % 40));
    if (!arrays) continue;
    ++found;
    v1::BuildPhotonMapRequest request;
    ASSERT_TRUE(request.ParseFromString(bytes));
    ASSERT_TRUE(request.has_chunk());
    ASSERT_EQ(Joined(arrays->positions), request.chunk().positions());
    ASSERT_EQ(Joined(arrays->powers), request.chunk().powers());
    ASSERT_EQ(Joined(arrays->directions), request.chunk().directions());
  }
  EXPECT_GT(found, 1000);
}

}  // namespace
}  // namespace treelight::server
