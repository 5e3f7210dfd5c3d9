#include "client/query_file.h"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "client/answer_csv.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

absl::StatusOr<QueryPoints> ReadText(const std::string& text) {
  const std::string path = testing::TempDir() + "query_file_test." + std::to_string(getpid());
  std::ofstream(path, std::ios::binary) << text;
  auto points = ReadQueryFile(path);
  std::filesystem::remove(path);
  return points;
}

std::string ErrorOf(const std::string& text) {
  const auto points = ReadText(text);
  EXPECT_EQ(points.status().code(), absl::StatusCode::kInvalidArgument) << points.status();
  const std::string message(points.status().message());
  EXPECT_THAT(message, HasSubstr("query_file_test"));
  EXPECT_THAT(message, Not(HasSubstr("\n")));
  EXPECT_LT(message.size(), 400u);
  return message;
}

TEST(QueryFileTest, TheNumberOfColumnsSaysWhatTheyAre) {
  const auto three = ReadText("1,2,3\n# half\n\n4, 5 ,6");
  ASSERT_TRUE(three.ok()) << three.status();
  EXPECT_THAT(three->positions, ElementsAre(1, 2, 3, 4, 5, 6));
  EXPECT_THAT(three->normals, IsEmpty());
  EXPECT_THAT(three->radii, IsEmpty());
  const auto four = ReadText("1,2,3,inf\r\n1,2,3,0.5\r\n");
  ASSERT_TRUE(four.ok()) << four.status();
  EXPECT_THAT(four->radii, ElementsAre(INFINITY, 0.5f));
  const auto six = ReadText("1,2,3,0,0,1\n");
  ASSERT_TRUE(six.ok()) << six.status();
  EXPECT_THAT(six->normals, ElementsAre(0, 0, 1));
  const auto seven = ReadText("1,2,3,0,0,1,9\n");
  ASSERT_TRUE(seven.ok()) << seven.status();
  EXPECT_THAT(seven->normals, ElementsAre(0, 0, 1));
  EXPECT_THAT(seven->radii, ElementsAre(9));
}

TEST(QueryFileTest, AByteOrderMarkIsSkipped) {
  for (const char* rest : {"1,2,3\n", "x,y,z\n1,2,3\n", "# points\n1,2,3\n", "\r\n1,2,3\r\n"}) {
    const auto points = ReadText(std::string("\xef\xbb\xbf") + rest);
    ASSERT_TRUE(points.ok()) << points.status();
    EXPECT_THAT(points->positions, ElementsAre(1, 2, 3));
  }
  EXPECT_THAT(ErrorOf("1,2,3\n\xef\xbb\xbf"
                      "1,2,3\n"),
              HasSubstr(":2: "));
}

TEST(QueryFileTest, NamedColumnsMayStandInAnyOrder) {
  const auto points = ReadText("r,z,y,x\n4,3,2,1\n");
  ASSERT_TRUE(points.ok()) << points.status();
  EXPECT_THAT(points->positions, ElementsAre(1, 2, 3));
  EXPECT_THAT(points->radii, ElementsAre(4));
}

TEST(QueryFileTest, PlyGivesTheSamePoints) {
  const auto points = ReadText(
      "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float "
      "z\n"
      "property uchar red\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float "
      "radius\n"
      "end_header\n1 2 3 255 0 0 1 0.5\n");
  ASSERT_TRUE(points.ok()) << points.status();
  EXPECT_THAT(points->positions, ElementsAre(1, 2, 3));
  EXPECT_THAT(points->normals, ElementsAre(0, 0, 1));
  EXPECT_THAT(points->radii, ElementsAre(0.5f));
}

TEST(QueryFileTest, FloatsKeepTheirBits) {
  const auto points = ReadText("0.1,1e-45,-3.4028235e17\n");
  ASSERT_TRUE(points.ok()) << points.status();
  EXPECT_THAT(points->positions, ElementsAre(0.1f, 1e-45f, -3.4028235e17f));
}

TEST(QueryFileTest, ErrorsNameTheLine) {
  EXPECT_THAT(ErrorOf("1,2,3\n1,2\n"), HasSubstr(":2: 2 columns, expected 3"));
  EXPECT_THAT(ErrorOf("1,2,3\n# c\n1,b,3\n"), HasSubstr(":3: column 2 is 'b', no number"));
  EXPECT_THAT(ErrorOf("1,2,3\n1,,3\n"), HasSubstr(":2: column 2 is '', no number"));
  EXPECT_THAT(ErrorOf("1,2\n"), HasSubstr(":1: 2 columns without names, expected 3, 4, 6 or 7"));
  EXPECT_THAT(ErrorOf("x,y,w\n"), HasSubstr(":1: 'w' is neither a number nor a column"));
  EXPECT_THAT(ErrorOf("x,y,r\n"), HasSubstr(":1: no column z"));
  EXPECT_THAT(ErrorOf("x,y,z,x\n"), HasSubstr(":1: two columns x"));
  EXPECT_THAT(ErrorOf("x,y,z,nx\n"), HasSubstr(":1: no column ny"));
  EXPECT_THAT(ErrorOf("x,y,z,nz\n"), HasSubstr(":1: no column nx"));
  EXPECT_THAT(ErrorOf("1,nan,3\n"), HasSubstr(":1: y is nan, it must be finite and within 1e+18"));
  EXPECT_THAT(ErrorOf("1,2,3,-1\n"), HasSubstr(":1: r is -1, it must be a float32 >= 0 or inf"));
  EXPECT_THAT(ErrorOf("1,2,3,nan\n"), HasSubstr(":1: r is nan"));
  EXPECT_THAT(ErrorOf("1,2," + std::string(10'000, '3')), HasSubstr(":1: the line is longer"));
}

TEST(QueryFileTest, NoPointsAreAnError) {
  EXPECT_THAT(ErrorOf(""), HasSubstr("it has no points"));
  EXPECT_THAT(ErrorOf("x,y,z\n# nothing\n"), HasSubstr("it has no points"));
}

TEST(QueryFileTest, RandomBytesNeverCrash) {
  std::mt19937 random(1);
  const std::string alphabet = "0123456789.,-e\n#xyznr \t\r";
  int refused_count = 0;
  for (int round = 0; round < 3000; ++round) {
    std::string text;
    for (std::size_t i = random() % 60; i > 0; --i) {
      text.push_back(round % 2 == 0 ? static_cast<char>(random())
                                    : alphabet[random() % alphabet.size()]);
    }
    const auto points = ReadText(text);
    if (!points.ok()) ++refused_count;
    ASSERT_TRUE(!points.ok() || points->positions.size() % 3 == 0);
  }
  EXPECT_GT(refused_count, 2000);
}

TEST(QueryFileTest, SlicesViewTheirPoints) {
  const QueryPoints points{
      .positions = {1, 2, 3, 4, 5, 6, 7, 8, 9}, .normals = {}, .radii = {10, 11, 12}};
  const GatherQueries slice = points.Slice(1, 2);
  EXPECT_THAT(slice.positions, ElementsAre(4, 5, 6, 7, 8, 9));
  EXPECT_THAT(slice.normals, IsEmpty());
  EXPECT_THAT(slice.radii, ElementsAre(11, 12));
}

TEST(AnswerCsvTest, EveryOutputHasItsColumns) {
  GatherResult result;
  result.counts = {2, 0};
  result.radii = {0.1f, INFINITY};
  result.neighbor_ids = {7, 3, kNoPhoton, kNoPhoton, kNoPhoton, kNoPhoton};
  result.neighbor_squared_distances = {0.01f, 0.04f, INFINITY, INFINITY, INFINITY, INFINITY};
  result.densities = {1, 2, 3, 0, 0, 0};
  result.nodes_visited = {11, 12};
  result.distance_tests = {21, 22};
  const std::uint32_t all =
      kOutputCount | kOutputRadius | kOutputNeighbors | kOutputDensity | kOutputStatistics;
  EXPECT_EQ(AnswerCsvHeader(all),
            "query,count,radius,density_red,density_green,density_blue,nodes_visited,distance_"
            "tests,neighbor_ids,"
            "neighbor_squared_distances\n");
  EXPECT_EQ(AnswerCsvLines(result, all, /*k=*/3, /*query_count=*/2, /*first_query=*/100),
            "100,2,0.1,1,2,3,11,21,7 3,0.01 0.04\n101,0,inf,0,0,0,12,22,,\n");
}

TEST(AnswerCsvTest, UncappedListsEndAtTheirOffsets) {
  GatherResult result;
  result.neighbor_ids = {5, 6, 9};
  result.neighbor_squared_distances = {0, 1, 2};
  result.neighbor_offsets = {0, 0, 2, 3};
  EXPECT_EQ(AnswerCsvHeader(kOutputNeighbors), "query,neighbor_ids,neighbor_squared_distances\n");
  EXPECT_EQ(AnswerCsvLines(result, kOutputNeighbors, /*k=*/0, /*query_count=*/3, /*first_query=*/0),
            "0,,\n1,5 6,0 1\n2,9,2\n");
}

}  // namespace
}  // namespace treelight::client
