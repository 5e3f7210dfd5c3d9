#include "client/progress.h"

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

std::string Contents(std::FILE* file) {
  std::rewind(file);
  std::string text(1000, '\0');
  text.resize(std::fread(text.data(), 1, text.size(), file));
  return text;
}

TEST(ProgressTest, ShortWorkSaysNothingInALog) {
  const File file(std::tmpfile(), std::fclose);
  Progress("upload", 10, "photons", file.get()).Update(10);
  EXPECT_EQ(Contents(file.get()), "");
}

TEST(ProgressTest, LongWorkSaysPlainLinesInALog) {
  const File file(std::tmpfile(), std::fclose);
  {
    Progress progress("upload", 10, "photons", file.get());
    std::this_thread::sleep_for(std::chrono::milliseconds(2100));
    progress.Update(4);
    progress.Update(10);
    progress.End();
  }
  EXPECT_EQ(Contents(file.get()),
            "upload: 40 %, 4 of 10 photons\nupload: 100 %, 10 of 10 photons\n");
}

TEST(ProgressTest, ATerminalShowsABar) {
  const int terminal = posix_openpt(O_RDWR | O_NOCTTY);
  ASSERT_GE(terminal, 0);
  ASSERT_EQ(grantpt(terminal), 0);
  ASSERT_EQ(unlockpt(terminal), 0);
  const File file(std::fopen(ptsname(terminal), "w"), std::fclose);
  ASSERT_NE(file, nullptr);
  {
    Progress progress("gather", 200, "queries", file.get());
    std::this_thread::sleep_for(std::chrono::milliseconds(150));
    progress.Update(100);
    progress.Update(200);
  }
  std::string text(1000, '\0');
  text.resize(read(terminal, text.data(), text.size()));
  close(terminal);
  EXPECT_THAT(text,
              StartsWith("\rgather [###############...............]  50 % 100/200 queries\r"));
  EXPECT_THAT(text, HasSubstr("[##############################] 100 % 200/200 queries"));
  EXPECT_THAT(text, EndsWith("\n"));
}

}  // namespace
}  // namespace treelight::client
