#include "client/table.h"

#include "gtest/gtest.h"

namespace treelight::client {
namespace {

TEST(TableTest, NumbersStandToTheRightAndWordsToTheLeft) {
  EXPECT_EQ(
      Format({.head = {"stage", "time"}, .rows = {{"sort", "1.5 ms"}, {"hierarchy", "12.5 ms"}}}),
      "stage         time\n"
      "sort        1.5 ms\n"
      "hierarchy  12.5 ms\n");
}

TEST(TableTest, LinesEndWithoutBlanks) {
  EXPECT_EQ(Format({.head = {}, .rows = {{"a", "never"}, {"bcd", ""}}}), "a    never\nbcd\n");
  EXPECT_EQ(Format({.head = {"name", "count"}, .rows = {}}), "name  count\n");
  EXPECT_EQ(Format({}), "");
}

TEST(TableTest, UnitsFitTheSize) {
  EXPECT_EQ(FormatBytes(812), "812 B");
  EXPECT_EQ(FormatBytes(1536), "1.5 KiB");
  EXPECT_EQ(FormatBytes(4.0 * (1 << 20)), "4.0 MiB");
  EXPECT_EQ(FormatMicroseconds(810), "0.81 ms");
  EXPECT_EQ(FormatMicroseconds(12'300'000), "12.30 s");
}

}  // namespace
}  // namespace treelight::client
