#include "server/convert.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "fmt/format.h"
#include "gtest/gtest.h"
#include "server/address.h"
#include "server/answer.h"
#include "server/gather_batch.h"
#include "server/refusal.h"
#include "server/upload.h"
#include "server/wire_build_options.h"
#include "tests/server_fixture.h"

namespace treelight::server {
namespace {

using treelight::testing::Array;
using treelight::testing::Bytes;
using treelight::testing::MakePhotons;
using treelight::testing::MakeUpload;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

v1::BuildHeader GoodHeader() { return MakeUpload("map", MakePhotons(10, 1))[0].header(); }

/// What ParseBuildHeader says of a good header after `change`.
template <typename Change>
std::string HeaderError(Change change) {
  v1::BuildHeader header = GoodHeader();
  change(header);
  return ParseBuildHeader(header, Limits{.max_photons = 1000}).status().ToString();
}

TEST(ParseBuildHeaderTest, TakesAGoodOneAndFillsDefaults) {
  v1::BuildHeader header = GoodHeader();
  header.set_time_to_live_ms(5);
  header.mutable_options()->set_morton_bits(63);
  const auto plan = ParseBuildHeader(header, {});
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->name, "map");
  EXPECT_EQ(plan->photon_count, 10u);
  EXPECT_TRUE(plan->has_powers);
  EXPECT_EQ(plan->options.morton_bits, MortonBits::k63);
  EXPECT_EQ(plan->options.builder, BuilderKind::kLbvh);
  EXPECT_EQ(plan->options.max_leaf_size, 16u);
  EXPECT_EQ(plan->options.heuristic, Heuristic::kIsa);
  EXPECT_EQ(plan->options.leaf_term, LeafTerm::kLeafSize);
  EXPECT_EQ(plan->options.treelet_size, 7u);
  EXPECT_EQ(plan->options.rounds, 3u);
  EXPECT_EQ(plan->options.radius, 0);
  EXPECT_EQ(plan->options.subtree_size, 256u);
  EXPECT_EQ(plan->time_to_live, std::chrono::milliseconds(5));
}

TEST(ParseBuildHeaderTest, EachErrorNamesFieldAndValue) {
  EXPECT_EQ(HeaderError([](auto& h) { h.clear_name(); }),
            "INVALID_ARGUMENT: header.name: 0 characters, it must have [1, 128]");
  EXPECT_EQ(HeaderError([](auto& h) { h.set_name(std::string(129, 'a')); }),
            "INVALID_ARGUMENT: header.name: 129 characters, it must have [1, 128]");
  EXPECT_EQ(HeaderError([](auto& h) { h.set_name("a/b"); }),
            "INVALID_ARGUMENT: header.name[1] is the byte 0x2f, allowed are A-Z a-z 0-9 . _ -");
  EXPECT_EQ(
      HeaderError([](auto& h) { h.set_request_id("\n"); }),
      "INVALID_ARGUMENT: header.request_id[0] is the byte 0x0a, allowed are A-Z a-z 0-9 . _ -");
  EXPECT_EQ(HeaderError([](auto& h) { h.set_photon_count(0); }),
            "INVALID_ARGUMENT: header.photon_count is 0, a map needs at least 1 photon");
  EXPECT_EQ(HeaderError([](auto& h) { h.set_photon_count(1001); }),
            "RESOURCE_EXHAUSTED: header.photon_count is 1001, the limit of a map is 1000 "
            "(--max-photons); build several maps or raise the limit");
  EXPECT_EQ(
      HeaderError([](auto& h) { h.set_time_to_live_ms(2'592'000'001); }),
      "INVALID_ARGUMENT: header.time_to_live_ms is 2592000001, at most 2592000000 (30 days) is "
      "possible");
  EXPECT_EQ(
      HeaderError([](auto& h) { h.mutable_options()->set_morton_bits(31); }),
      "INVALID_ARGUMENT: options.morton_bits is 31, it must be 30 or 63, or 0 for the default");
  EXPECT_EQ(HeaderError([](auto& h) { h.mutable_options()->set_max_leaf_size(65); }),
            "INVALID_ARGUMENT: options.max_leaf_size is 65, it must be in [1, 64], or 0 for the "
            "default");
  EXPECT_EQ(HeaderError([](auto& h) {
              h.mutable_options()->set_builder(static_cast<v1::BuilderKind>(99));
            }),
            "INVALID_ARGUMENT: options.builder is 99, no such builder");
  EXPECT_EQ(HeaderError([](auto& h) {  // taken away
              h.mutable_options()->set_builder(static_cast<v1::BuilderKind>(7));
            }),
            "INVALID_ARGUMENT: options.builder is 7, no such builder");
}

/// What ParseBuildOptions says of the options of `builder` after `change`.
template <typename Change>
std::string OptionError(v1::BuilderKind builder, Change change) {
  v1::BuildOptions options;
  options.set_builder(builder);
  change(options);
  return ParseBuildOptions(options).status().ToString();
}

TEST(ParseBuildOptionsTest, EachErrorNamesFieldAndValue) {
  const auto treelet = v1::BUILDER_KIND_TREELET, trbvh = v1::BUILDER_KIND_TRBVH;
  EXPECT_EQ(OptionError(treelet, [](auto& o) { o.set_treelet_size(17); }),
            "INVALID_ARGUMENT: options.treelet_size is 17, it must be in [3, 16], or 0 for the "
            "default");
  EXPECT_EQ(OptionError(trbvh, [](auto& o) { o.set_treelet_size(10); }),
            "INVALID_ARGUMENT: options.treelet_size is 10, it must be in [3, 9], or 0 for the "
            "default");
  EXPECT_EQ(OptionError(treelet, [](auto& o) { o.set_rounds(9); }),
            "INVALID_ARGUMENT: options.rounds is 9, it must be in [1, 8], or 0 for the default");
  EXPECT_EQ(OptionError(treelet, [](auto& o) { o.set_radius(-1); }),
            "INVALID_ARGUMENT: options.radius is -1, it must be in [0, 1e+18], or 0 for the "
            "default");
  EXPECT_EQ(OptionError(treelet, [](auto& o) { o.set_radius(NAN); }),
            "INVALID_ARGUMENT: options.radius is nan, it must be in [0, 1e+18], or 0 for the "
            "default");
  EXPECT_EQ(OptionError(v1::BUILDER_KIND_HYBRID,
                        [](auto& o) {
                          o.set_max_leaf_size(32);
                          o.set_subtree_size(31);
                        }),
            "INVALID_ARGUMENT: options.subtree_size is 31, it must be in [32, 4096], or 0 for the "
            "default");
  EXPECT_EQ(OptionError(treelet, [](auto& o) { o.set_heuristic(static_cast<v1::Heuristic>(4)); }),
            "INVALID_ARGUMENT: options.heuristic is 4, no such heuristic");
  EXPECT_EQ(OptionError(treelet, [](auto& o) { o.set_leaf_term(static_cast<v1::LeafTerm>(3)); }),
            "INVALID_ARGUMENT: options.leaf_term is 3, no such leaf_term");
}

TEST(ParseBuildOptionsTest, WhatABuilderDoesNotReadIsIgnored) {
  EXPECT_EQ(OptionError(v1::BUILDER_KIND_LBVH, [](auto& o) { o.set_rounds(9); }), "OK");
  EXPECT_EQ(OptionError(v1::BUILDER_KIND_TREELET, [](auto& o) { o.set_subtree_size(1); }), "OK");
}

// Every builder of the wire, with every field that it reads, comes back as it went.
TEST(ParseBuildOptionsTest, OptionsComeBackAsTheyWent) {
  for (int builder = v1::BUILDER_KIND_LBVH; builder <= v1::BUILDER_KIND_KARRAS; ++builder) {
    if (!v1::BuilderKind_IsValid(builder)) continue;
    v1::BuildOptions all;
    all.set_builder(static_cast<v1::BuilderKind>(builder));
    all.set_morton_bits(63);
    all.set_max_leaf_size(8);
    all.set_heuristic(v1::HEURISTIC_VVH);
    all.set_leaf_term(v1::LEAF_TERM_NONE);
    all.set_treelet_size(9);
    all.set_rounds(2);
    all.set_radius(0.5f);
    all.set_subtree_size(1024);
    const auto options = ParseBuildOptions(all);
    ASSERT_TRUE(options.ok()) << options.status();
    BuildReport report;
    report.radius = 0.5f;
    const auto back = ToWire(*options, report);
    EXPECT_EQ(back.builder(), all.builder());
    EXPECT_EQ(back.max_leaf_size(), 8u);
    EXPECT_EQ(back.radius(), 0.5f);
    const auto again = ParseBuildOptions(back);
    ASSERT_TRUE(again.ok()) << again.status();
    EXPECT_EQ(BuilderName(*again), BuilderName(*options));
    EXPECT_EQ(back.heuristic(),
              ReadsHeuristic(options->builder) ? v1::HEURISTIC_VVH : v1::HEURISTIC_UNSPECIFIED);
    EXPECT_EQ(back.rounds(), ReadsTreelets(options->builder) ? 2u : 0u);
    EXPECT_EQ(back.morton_bits(), ReadsMortonBits(options->builder) ? 63u : 0u);
    EXPECT_EQ(back.subtree_size(), options->builder == BuilderKind::kHybrid ? 1024u : 0u);
  }
}

// Compatibility: the bytes of a client that knows fields 1 to 3 alone.
TEST(ParseBuildOptionsTest, AnOldClientGetsTheDefaults) {
  v1::BuildOptions options;
  ASSERT_TRUE(options.ParseFromString(std::string("\x08\x01\x10\x3f\x18\x08", 6)));
  const auto parsed = ParseBuildOptions(options);
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_EQ(parsed->builder, BuilderKind::kLbvh);
  EXPECT_EQ(parsed->morton_bits, MortonBits::k63);
  EXPECT_EQ(parsed->max_leaf_size, 8u);
}

/// What Upload says of two chunks of two photons each, the second after `change`.
template <typename Change>
std::string ChunkError(Change change) {
  auto messages = MakeUpload("map", MakePhotons(4, 1), 2);
  change(*messages[2].mutable_chunk());
  auto upload =
      Upload::Start(*ParseBuildHeader(messages[0].header(), {}), {.max_chunk_bytes = 100});
  EXPECT_TRUE(upload->Add(ArraysOf(messages[1].chunk())).ok());
  return upload->Add(ArraysOf(messages[2].chunk())).ToString();
}

/// Replaces number `index` of `bytes`.
std::string With(const std::string& bytes, std::size_t index, float value) {
  auto numbers = Array<float>(bytes);
  numbers[index] = value;
  return Bytes(numbers);
}

TEST(UploadTest, PutsChunksTogether) {
  const Photons photons = MakePhotons(1237, 1);
  const auto messages = MakeUpload("map", photons, 100);
  auto upload = Upload::Start(*ParseBuildHeader(messages[0].header(), {}), {});
  for (std::size_t i = 1; i < messages.size(); ++i) {
    ASSERT_TRUE(upload->Add(ArraysOf(messages[i].chunk())).ok());
  }
  const auto all = (*std::move(upload)).Finish();
  ASSERT_TRUE(all.ok()) << all.status();
  EXPECT_EQ(all->positions, photons.positions);
  EXPECT_EQ(all->powers, photons.powers);
  EXPECT_EQ(all->directions, photons.directions);
}

TEST(UploadTest, NumbersMayLieInSeveralPieces) {
  const Photons photons = MakePhotons(5000, 1);
  const auto messages = MakeUpload("map", photons, 5000);
  const v1::PhotonChunk& chunk = messages[1].chunk();
  const auto split = [](std::string_view bytes, std::size_t size) {
    Pieces pieces;
    for (; !bytes.empty(); bytes.remove_prefix(std::min(size, bytes.size())))
      pieces.push_back(bytes.substr(0, size));
    return pieces;
  };
  for (const std::size_t size : {1u, 5u, 1021u, 12288u, 16384u, 40000u}) {
    auto upload = Upload::Start(*ParseBuildHeader(messages[0].header(), {}), {});
    const ChunkArrays arrays = {.positions = split(chunk.positions(), size),
                                .powers = split(chunk.powers(), size + 1),
                                .directions = split(chunk.directions(), size + 2)};
    ASSERT_TRUE(upload->Add(arrays).ok());
    const auto all = (*std::move(upload)).Finish();
    ASSERT_TRUE(all.ok()) << all.status();
    EXPECT_EQ(all->positions, photons.positions);
    EXPECT_EQ(all->powers, photons.powers);
    EXPECT_EQ(all->directions, photons.directions);
  }
  // The last number of an array and one behind the first block of it.
  for (const std::size_t wrong : {std::size_t{14999}, std::size_t{3072}}) {
    const std::string positions = With(chunk.positions(), wrong, NAN);
    auto upload = Upload::Start(*ParseBuildHeader(messages[0].header(), {}), {});
    EXPECT_EQ(upload
                  ->Add({.positions = split(positions, 1001),
                         .powers = {chunk.powers()},
                         .directions = {chunk.directions()}})
                  .message(),
              fmt::format("chunk.positions: number {} of photon {} is nan, it must be finite and "
                          "within 1e+18",
                          wrong % 3, wrong / 3));
  }
}

TEST(UploadTest, EachErrorNamesFieldIndexAndValue) {
  EXPECT_EQ(ChunkError([](auto& c) { c.set_positions(With(c.positions(), 4, NAN)); }),
            "INVALID_ARGUMENT: chunk.positions: number 1 of photon 3 is nan, it must be finite and "
            "within 1e+18");
  EXPECT_EQ(
      ChunkError([](auto& c) { c.set_positions(With(c.positions(), 0, -1.01e18f)); }),
      "INVALID_ARGUMENT: chunk.positions: number 0 of photon 2 is -1.01e+18, it must be finite "
      "and within 1e+18");
  EXPECT_EQ(ChunkError([](auto& c) { c.set_powers(With(c.powers(), 5, kInfinity)); }),
            "INVALID_ARGUMENT: chunk.powers: number 2 of photon 3 is inf, it must be finite and "
            "within 3.40282e+38");
  EXPECT_EQ(ChunkError([](auto& c) { c.mutable_positions()->pop_back(); }),
            "INVALID_ARGUMENT: chunk.positions: 23 bytes are no multiple of 12, three float32");
  EXPECT_EQ(ChunkError([](auto& c) { c.clear_positions(); }),
            "INVALID_ARGUMENT: chunk.positions: 0 photons, a chunk holds at least 1");
  EXPECT_EQ(
      ChunkError([](auto& c) { c.clear_powers(); }),
      "INVALID_ARGUMENT: chunk.powers: 0 bytes, expected 24 (12 bytes for each of 2 photons)");
  EXPECT_EQ(
      ChunkError([](auto& c) { c.mutable_directions()->append("xxxx"); }),
      "INVALID_ARGUMENT: chunk.directions: 12 bytes, expected 8 (4 bytes for each of 2 photons)");
  EXPECT_EQ(
      ChunkError([](auto& c) {
        c.set_positions(std::string(36, '\0'));
        c.set_powers(std::string(36, '\0'));
        c.set_directions(std::string(12, '\0'));
      }),
      "INVALID_ARGUMENT: chunk.positions: 3 photons after 2, header.photon_count announced 4");
  EXPECT_EQ(
      ChunkError([](auto& c) { c.set_powers(std::string(100, 'x')); }),
      "INVALID_ARGUMENT: chunk: arrays of 132 bytes, at most 100 (ServerLimits.max_chunk_bytes) "
      "are possible; send smaller chunks");
}

TEST(UploadTest, AnArrayThatWasNotAnnouncedIsRefused) {
  auto messages = MakeUpload("map", MakePhotons(2, 1));
  messages[0].mutable_header()->set_has_powers(false);
  auto upload = Upload::Start(*ParseBuildHeader(messages[0].header(), {}), {});
  EXPECT_EQ(upload->Add(ArraysOf(messages[1].chunk())).ToString(),
            "INVALID_ARGUMENT: chunk.powers: 24 bytes, but header.has_powers is false");
}

TEST(CheckDeviceRoomTest, NamesTheBufferAndTheMemory) {
  BuildPlan plan;
  plan.photon_count = 100;
  plan.has_powers = true;
  DeviceInfo device;
  device.name = "d";
  device.memory_bytes = 10'000;
  device.max_buffer_bytes = 1599;
  const std::string what = "header.photon_count is 100";
  constexpr std::chrono::milliseconds kDelay{5};
  EXPECT_EQ(CheckDeviceRoom(plan, device, 0, what, kDelay).message(),
            "header.photon_count is 100: a buffer of 1600 bytes, the largest of "
            "device 'd' is 1599, 99 photons; build several maps");
  device.max_buffer_bytes = 1600;
  EXPECT_TRUE(CheckDeviceRoom(plan, device, 7200, what, kDelay).ok());
  const auto refused = CheckDeviceRoom(plan, device, 7201, what, kDelay);
  EXPECT_EQ(refused.message(),
            "header.photon_count is 100: at least 2800 bytes, device 'd' has 10000 of which maps "
            "hold 7201; delete maps or build a smaller one");
  EXPECT_EQ(RefusedQuota(refused), "device");
  // A repeat may help where maps are in the way.
  const auto has_delay = [](const absl::Status& status) {
    return ToRpcStatus(status).details_size() == 2;
  };
  EXPECT_TRUE(has_delay(refused));
  device.memory_bytes = 2799;
  EXPECT_FALSE(has_delay(CheckDeviceRoom(plan, device, 0, what, kDelay)));
}

TEST(AddressTest, OnlyLoopbackIsLocal) {
  for (const char* local :
       {"127.0.0.1:1", "127.9.9.9:1", "localhost:0", "[::1]:5", "unix:/tmp/s"}) {
    EXPECT_TRUE(CheckAddress(local).ok()) << local;
    EXPECT_TRUE(IsLocal(local)) << local;
  }
  for (const char* remote :
       {"0.0.0.0:1", "[::]:1", "example.org:1", "128.0.0.1:1", "127.0.0.1.org:1"}) {
    EXPECT_TRUE(CheckAddress(remote).ok()) << remote;
    EXPECT_FALSE(IsLocal(remote)) << remote;
  }
  for (const char* wrong : {"", "host", ":1", "::1:1", "h:", "h:65536", "h:-1", "h:1x", "unix:"}) {
    EXPECT_FALSE(CheckAddress(wrong).ok()) << wrong;
  }
}

TEST(AnswerTest, PartsOfUncappedListsHoldEveryQueryOnceAndRestartAtZero) {
  // Query i has i neighbours: 8 bytes each, and 8 for its offset.
  GatherResult result;
  result.neighbor_offsets = {0};
  for (std::uint32_t i = 0; i < 50; ++i) {
    for (std::uint32_t j = 0; j < i; ++j) {
      result.neighbor_ids.push_back(100 * i + j);
      result.neighbor_squared_distances.push_back(static_cast<float>(j));
    }
    result.neighbor_offsets.push_back(result.neighbor_ids.size());
  }
  const GatherOptions options{.k = 0, .radius = 1, .outputs = kOutputNeighbors};
  const Limits limits{.max_message_bytes = 2000, .max_part_bytes = 1500};
  std::size_t first = 0, parts = 0;
  while (first < 50) {
    const auto last = FindPartEnd(result, options, v1::FLOAT_FORMAT_FLOAT32, 50, first, limits);
    ASSERT_TRUE(last.ok()) << last.status();
    ASSERT_GT(*last, first);
    v1::GatherResponse part;
    WritePart(result, options, v1::FLOAT_FORMAT_FLOAT32, first, *last, part);
    const auto offsets = Array<std::uint64_t>(part.neighbor_offsets());
    const auto ids = Array<std::uint32_t>(part.neighbor_ids());
    ASSERT_EQ(offsets.size(), *last - first + 1);
    EXPECT_EQ(offsets.front(), 0u);
    EXPECT_EQ(offsets.back(), ids.size());
    for (std::size_t i = first; i < *last; ++i) {
      ASSERT_EQ(offsets[i - first + 1] - offsets[i - first], i);
      if (i > 0) {
        EXPECT_EQ(ids[offsets[i - first]], 100 * i);
      }
    }
    EXPECT_TRUE(*last - first == 1 || part.ByteSizeLong() <= limits.max_part_bytes);
    first = *last;
    ++parts;
  }
  EXPECT_GT(parts, 10u);
  // A list that no message holds.
  EXPECT_EQ(
      FindPartEnd(result, options, v1::FLOAT_FORMAT_FLOAT32, 50, 49, {.max_message_bytes = 1400})
          .status()
          .ToString(),
      "RESOURCE_EXHAUSTED: query 49 has 49 neighbours, 400 bytes, the limit of a message is 1400; "
      "give k > 0 or a smaller radius");
}

}  // namespace
}  // namespace treelight::server
