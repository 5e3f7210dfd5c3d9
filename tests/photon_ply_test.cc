#include "client/photon_ply.h"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "client/output_file.h"
#include "client/photon_spool.h"
#include "core/model/octahedral.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;

/// A file name of this test alone; the file goes with the object.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& text = {})
      : path_(testing::TempDir() + "photon_ply_test." + std::to_string(getpid()) + ".ply") {
    std::ofstream(path_, std::ios::binary) << text;
  }
  ~TemporaryFile() { std::filesystem::remove(path_); }

  const std::string& path() const { return path_; }
  std::string Text() const {
    std::ifstream stream(path_, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }

 private:
  std::string path_;
};

absl::StatusOr<Photons> ReadText(const std::string& text) {
  const TemporaryFile file(text);
  return ReadPhotonPly(file.path());
}

Photons MakePhotons(std::size_t count, int seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> coordinate(-10, 10), power(0, 1e-6f);
  std::uniform_int_distribution<int> direction(-32767, 32767);
  Photons photons;
  for (std::size_t i = 0; i < 3 * count; ++i) photons.positions.push_back(coordinate(random));
  for (std::size_t i = 0; i < 3 * count; ++i) photons.powers.push_back(power(random));
  for (std::size_t i = 0; i < 2 * count; ++i) {
    photons.directions.push_back(static_cast<std::int16_t>(direction(random)));
  }
  return photons;
}

void ExpectSameBits(const Photons& read, const Photons& written) {
  EXPECT_EQ(read.positions, written.positions);
  EXPECT_EQ(read.powers, written.powers);
  EXPECT_EQ(read.directions, written.directions);
}

void ExpectOneClearLine(const absl::Status& status) {
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("photon_ply_test"));  // the file is named
  EXPECT_THAT(std::string(status.message()), Not(HasSubstr("\n")));
  EXPECT_LT(status.message().size(), 400u);
}

TEST(PhotonPlyTest, WhatIsWrittenIsReadBackBitByBit) {
  for (const std::size_t count : {0, 1, 2, 40'009}) {
    const Photons photons = MakePhotons(count, /*seed=*/1);
    const TemporaryFile file;
    ASSERT_TRUE(WritePhotonPly(file.path(), photons).ok());
    const auto read = ReadPhotonPly(file.path());
    ASSERT_TRUE(read.ok()) << read.status();
    ExpectSameBits(*read, photons);
  }
}

TEST(PhotonPlyTest, PositionsAloneAreAPhotonFile) {
  Photons photons = MakePhotons(5, /*seed=*/2);
  photons.powers.clear();
  photons.directions.clear();
  const TemporaryFile file;
  ASSERT_TRUE(WritePhotonPly(file.path(), photons).ok());
  EXPECT_THAT(file.Text(), Not(HasSubstr("red")));
  const auto read = ReadPhotonPly(file.path());
  ASSERT_TRUE(read.ok()) << read.status();
  ExpectSameBits(*read, photons);
}

TEST(PhotonPlyTest, ViewersFindColoursRelativeToTheStrongestPower) {
  const Photons photons{.positions = {1, 2, 3}, .powers = {8e-6f, 0, 4e-6f}, .directions = {}};
  const TemporaryFile file;
  ASSERT_TRUE(WritePhotonPly(file.path(), photons).ok());
  const std::string text = file.Text();
  EXPECT_THAT(text, HasSubstr("format binary_little_endian 1.0\n"));
  EXPECT_THAT(
      text,
      HasSubstr("property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"));
  EXPECT_THAT(text, EndsWith(std::string_view("\xff\x00\xba", 3)));  // 255 * 0.5^(1/2.2) = 186
}

TEST(PhotonPlyTest, AsciiIsReadAndOtherPropertiesAndElementsAreSkipped) {
  const auto photons = ReadText(
      "ply\r\nformat ascii 1.0\ncomment by hand\nobj_info x\nelement camera 2\nproperty list uchar "
      "int views\n"
      "property float f\nelement vertex 2\nproperty float confidence\nproperty double z\nproperty "
      "float x\n"
      "property list uchar int links\nproperty float32 y\nproperty float power_green\nproperty "
      "float power_red\n"
      "property float power_blue\nelement face 1\nproperty list uchar int "
      "vertex_indices\nend_header\n"
      "3 1 2 3 0.5\n0 1\n0.9 3 1 2 7 8 2 20 10 30\n\n 0.9\t-3 -1 0 -2 21 11 31 \n3 0 1 0\n");
  ASSERT_TRUE(photons.ok()) << photons.status();
  EXPECT_THAT(photons->positions, ElementsAre(1, 2, 3, -1, -2, -3));
  EXPECT_THAT(photons->powers, ElementsAre(10, 20, 30, 11, 21, 31));
  EXPECT_TRUE(photons->directions.empty());
}

TEST(PhotonPlyTest, OnlyWantedAttributesAreRead) {
  const Photons photons = MakePhotons(1'000, /*seed=*/5);
  const TemporaryFile file("");
  ASSERT_TRUE(WritePhotonPly(file.path(), photons).ok());
  for (const PhotonAttributes& wanted :
       {PhotonAttributes{.powers = true, .directions = false}, {.powers = false}, {false, false}}) {
    const auto read = ReadPhotonPly(file.path(), wanted);
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->positions, photons.positions);
    EXPECT_EQ(read->powers, wanted.powers ? photons.powers : std::vector<float>());
    EXPECT_EQ(read->directions,
              wanted.directions ? photons.directions : std::vector<std::int16_t>());
  }
}

TEST(PhotonPlyTest, BinaryListsAndEveryNumberTypeAreSkipped) {
  std::string text =
      "ply\nformat binary_little_endian 1.0\nelement other 1\nproperty list ushort double "
      "values\nelement vertex 1\n"
      "property char a\nproperty float x\nproperty ushort b\nproperty uint8 c\nproperty float y\n"
      "property list uint8 int16 d\nproperty double e\nproperty int32 z\nend_header\n";
  const auto append = [&](auto value) {
    text.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  append(std::uint16_t{2}), append(1.0), append(2.0);
  append(std::int8_t{-1}), append(1.5f), append(std::uint16_t{9}), append(std::uint8_t{8}),
      append(2.5f);
  append(std::uint8_t{1}), append(std::int16_t{77}), append(0.25), append(std::int32_t{-3});
  const auto photons = ReadText(text);
  ASSERT_TRUE(photons.ok()) << photons.status();
  EXPECT_THAT(photons->positions, ElementsAre(1.5f, 2.5f, -3));
}

TEST(PhotonPlyTest, NormalsOfAnyLengthBecomeDirections) {
  const auto photons = ReadText(
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
      "z\n"
      "property float nx\nproperty float ny\nproperty float nz\nend_header\n0 0 0 0 6 -8\n");
  ASSERT_TRUE(photons.ok()) << photons.status();
  const auto code = EncodeOctahedral({0, 0.6f, -0.8f});
  EXPECT_THAT(photons->directions, ElementsAre(code[0], code[1]));
}

TEST(PhotonPlyTest, EveryTruncationOfABinaryFileIsOneClearError) {
  const TemporaryFile whole;
  ASSERT_TRUE(WritePhotonPly(whole.path(), MakePhotons(4, /*seed=*/3)).ok());
  const std::string text = whole.Text();
  ASSERT_GT(text.size(), 300u);
  for (std::size_t size = 0; size < text.size(); ++size) {
    const auto photons = ReadText(text.substr(0, size));
    ASSERT_FALSE(photons.ok()) << size;
    ExpectOneClearLine(photons.status());
  }
}

TEST(PhotonPlyTest, ATruncatedFileSaysWhereItEnds) {
  const TemporaryFile whole;
  ASSERT_TRUE(WritePhotonPly(whole.path(), MakePhotons(4, /*seed=*/3)).ok());
  const std::string text = whole.Text();
  const auto binary = ReadText(text.substr(0, text.size() - 1));
  EXPECT_THAT(std::string(binary.status().message()),
              HasSubstr("the file ends at byte " + std::to_string(text.size() - 1) +
                        ", within vertex 3 of 4"));
  const auto ascii = ReadText(
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float "
      "z\nend_header\n"
      "1 2 3\n");
  EXPECT_THAT(std::string(ascii.status().message()),
              HasSubstr(".ply:9: the file ends, in vertex 1 of 2"));
}

struct BadFile {
  std::string name, header, body, expected;
};

class BadPhotonPlyTest : public testing::TestWithParam<BadFile> {};

TEST_P(BadPhotonPlyTest, IsOneClearError) {
  const auto photons = ReadText(GetParam().header + GetParam().body);
  ASSERT_FALSE(photons.ok());
  ExpectOneClearLine(photons.status());
  EXPECT_THAT(std::string(photons.status().message()), HasSubstr(GetParam().expected));
}

const std::string kAscii = "ply\nformat ascii 1.0\n";
const std::string kBinary = "ply\nformat binary_little_endian 1.0\n";
const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";
const std::string kEnd = "end_header\n";

INSTANTIATE_TEST_SUITE_P(
    PhotonPly, BadPhotonPlyTest,
    testing::Values(
        BadFile{"NoPly", "plywood\n", "", "its first line is not 'ply'"},
        BadFile{"BigEndian", "ply\nformat binary_big_endian 1.0\n", "", ":2: big-endian"},
        BadFile{"NoFormat", "ply\nelement vertex 0\n" + kXyz + kEnd, "",
                ":6: the header has no format"},
        BadFile{"NoVertex", kAscii + "element face 0\n" + kXyz + kEnd, "", "no element 'vertex'"},
        BadFile{"NoZ", kAscii + "element vertex 0\nproperty float x\nproperty float y\n" + kEnd, "",
                "x, y and z"},
        BadFile{"NegativeCount", kAscii + "element vertex -1\n", "",
                ":3: expected 'element NAME COUNT'"},
        BadFile{"UnknownType", kAscii + "element vertex 1\nproperty half x\n", "",
                ":4: expected 'property"},
        BadFile{"FloatListCount", kAscii + "element vertex 1\nproperty list float int x\n", "",
                ":4: expected"},
        BadFile{"PropertyFirst", kAscii + "property float x\n", "",
                ":3: a property before the first element"},
        BadFile{"EndlessLine", "ply\n" + std::string(100'000, 'a'), "", ":2: "},
        BadFile{"HugeCount", kBinary + "element vertex 18446744073709551615\n" + kXyz + kEnd, "",
                "ends at byte"},
        BadFile{"HugeOtherElement",
                kBinary + "element a 18446744073709551615\nproperty int i\nelement vertex 1\n" +
                    kXyz + kEnd,
                "", "within a 0 of"},
        BadFile{
            "HugeList",
            kBinary + "element a 1\nproperty list uint double i\nelement vertex 1\n" + kXyz + kEnd,
            "\xff\xff\xff\xff", "within a 0 of 1"},
        BadFile{"NegativeList",
                kBinary + "element a 1\nproperty list char int i\nelement vertex 1\n" + kXyz + kEnd,
                "\xff", "has -1 numbers"},
        BadFile{"HalfAPower",
                kAscii + "element vertex 1\n" + kXyz + "property float power_red\n" + kEnd,
                "1 2 3 4\n", "no power_green"},
        BadFile{"Word", kAscii + "element vertex 1\n" + kXyz + kEnd, "1 two 3\n",
                ":8: 'two' is no number"},
        BadFile{"TooFew", kAscii + "element vertex 1\n" + kXyz + kEnd, "1 2\n",
                ":8: only 2 numbers"},
        BadFile{"TooMany", kAscii + "element vertex 1\n" + kXyz + kEnd, "1 2 3 4\n",
                ":8: 4 numbers, expected 3"},
        BadFile{"NotANumber", kAscii + "element vertex 1\n" + kXyz + kEnd, "1 nan 3\n",
                ":8: vertex 0: number 1"},
        BadFile{"TooFar", kAscii + "element vertex 1\n" + kXyz + kEnd, "1 2 1.1e18\n",
                "within 1e+18"},
        BadFile{"LongList",
                kAscii + "element vertex 1\n" + kXyz + "property list uchar int l\n" + kEnd,
                "1 2 3 5 1\n", ":9: a list with another count"},
        BadFile{"ZeroNormal",
                kAscii + "element vertex 1\n" + kXyz +
                    "property float nx\nproperty float ny\nproperty float nz\n" + kEnd,
                "1 2 3 0 0 0\n", "its normal has length 0"},
        BadFile{"DirectionTooLarge",
                kAscii + "element vertex 1\n" + kXyz + "property int dir_u\nproperty int dir_v\n" +
                    kEnd,
                "1 2 3 0 40000\n", "dir_v is 40000"}),
    [](const auto& instance) { return instance.param.name; });

TEST(PhotonPlyTest, RandomChangesNeverCrash) {
  const TemporaryFile whole;
  ASSERT_TRUE(WritePhotonPly(whole.path(), MakePhotons(4, /*seed=*/4)).ok());
  const std::string text = whole.Text();
  std::mt19937 random(5);
  int refused_count = 0;
  for (int round = 0; round < 3000; ++round) {
    std::string changed = text;
    for (int change = 0; change < 3; ++change)
      changed[random() % changed.size()] = static_cast<char>(random());
    const auto photons = ReadText(changed);
    if (photons.ok()) {
      EXPECT_TRUE(photons->powers.empty() || photons->powers.size() == photons->positions.size());
      continue;
    }
    ++refused_count;
    ExpectOneClearLine(photons.status());
  }
  EXPECT_GT(refused_count, 1000);
}

TEST(PhotonPlyTest, RandomBytesAreOneClearError) {
  std::mt19937 random(6);
  for (const std::string& start :
       {std::string(), std::string("ply\n"), kBinary + "element vertex 9\n"}) {
    for (int round = 0; round < 300; ++round) {
      std::string text = start;
      for (int i = 0; i < 500; ++i) text.push_back(static_cast<char>(random()));
      const auto photons = ReadText(text);
      ASSERT_FALSE(photons.ok());
      ExpectOneClearLine(photons.status());
    }
  }
}

TEST(PhotonPlyTest, AFileThatIsNotThereSaysSo) {
  const auto missing = ReadPhotonPly("/nowhere/photons.ply");
  EXPECT_EQ(missing.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(missing.status().message()),
              HasSubstr("/nowhere/photons.ply: No such file"));
  EXPECT_THAT(std::string(ReadPhotonPly("/").status().message()), HasSubstr("/: it is a folder"));
  const auto unwritable = WritePhotonPly("/nowhere/photons.ply", MakePhotons(1, /*seed=*/7));
  EXPECT_THAT(std::string(unwritable.message()),
              HasSubstr("cannot write /nowhere/photons.ply: No such file"));
}

// By way of the temporary file, in blocks of several sizes, the same file comes out.
TEST(PhotonPlyTest, BlocksMakeTheSameFile) {
  const Photons photons = MakePhotons(70'001, /*seed=*/9);
  auto spool = PhotonSpool::Create();
  ASSERT_TRUE(spool.ok()) << spool.status();
  for (std::size_t first = 0; first < photons.size();) {
    const std::size_t last = std::min(first + 1 + first / 3, photons.size());
    const auto part = [&](const auto& array, std::size_t width) {
      return std::vector(array.begin() + static_cast<std::ptrdiff_t>(width * first),
                         array.begin() + static_cast<std::ptrdiff_t>(width * last));
    };
    ASSERT_TRUE(spool
                    ->Append({.positions = part(photons.positions, 3),
                              .powers = part(photons.powers, 3),
                              .directions = part(photons.directions, 2)})
                    .ok());
    first = last;
  }
  EXPECT_EQ(spool->size(), photons.size());
  const TemporaryFile whole, blocks;
  ASSERT_TRUE(WritePhotonPly(whole.path(), photons).ok());
  auto file = OutputFile::Create(blocks.path());
  ASSERT_TRUE(file.ok());
  auto writer = PhotonPlyWriter::Create(
      *std::move(file),
      {.count = photons.size(), .max_power = *std::ranges::max_element(photons.powers)});
  ASSERT_TRUE(writer.ok());
  std::size_t block_count = 0;
  ASSERT_TRUE(spool
                  ->Read([&](Photons& block) {
                    ++block_count;
                    return writer->Write(block);
                  })
                  .ok());
  ASSERT_TRUE(writer->Commit().ok());
  EXPECT_GT(block_count, 2u);
  EXPECT_TRUE(blocks.Text() == whole.Text());
  const auto stopped = spool->Read([](Photons&) { return absl::CancelledError("enough"); });
  EXPECT_EQ(stopped.message(), "enough");
}

TEST(PhotonPlyTest, AWriterKeepsToWhatItsHeaderSays) {
  const TemporaryFile path("before");
  auto file = OutputFile::Create(path.path());
  ASSERT_TRUE(file.ok());
  auto writer = PhotonPlyWriter::Create(*std::move(file), {.count = 3, .directions = false});
  ASSERT_TRUE(writer.ok());
  Photons photons = MakePhotons(2, /*seed=*/10);
  EXPECT_EQ(writer->Write(photons).code(), absl::StatusCode::kInvalidArgument);
  photons.directions.clear();
  EXPECT_TRUE(writer->Write(photons).ok());
  EXPECT_EQ(writer->Commit().message(), "2 photons were written, 3 announced");
  EXPECT_EQ(path.Text(), "before");
}

TEST(PhotonPlyTest, UnequalArraysAreNotWritten) {
  Photons photons = MakePhotons(2, /*seed=*/8);
  photons.powers.pop_back();
  const TemporaryFile file("before");
  EXPECT_EQ(WritePhotonPly(file.path(), photons).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(file.Text(), "before");
}

}  // namespace
}  // namespace treelight::client
