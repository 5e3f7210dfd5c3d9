#include "tests/stability/child_process.h"

#include <unistd.h>

#include <csignal>
#include <stdexcept>
#include <vector>

#include "gtest/gtest.h"

namespace treelight {
namespace {

TEST(ChildProcessTest, TellsWhatTheWorkReturned) {
  const std::string text(100000, 'x');  // more than a pipe holds
  const ChildEnd end = RunInChild({}, [&] { return text; });
  EXPECT_EQ(end.kind, ChildEnd::kReturned);
  EXPECT_EQ(end.answer, text);
  EXPECT_EQ(Describe(end, {}), "");
}

TEST(ChildProcessTest, ACrashIsToldByItsSignal) {
  const ChildEnd end = RunInChild({}, [] {
    std::raise(SIGSEGV);
    return std::string();
  });
  EXPECT_EQ(Describe(end, {}), "crash (SIGSEGV)");
}

TEST(ChildProcessTest, AnExceptionIsToldByItsText) {
  const ChildEnd end = RunInChild({}, []() -> std::string { throw std::runtime_error("no axis"); });
  EXPECT_EQ(Describe(end, {}), "exception: no axis");
}

TEST(ChildProcessTest, WorkWithoutEndIsEnded) {
  const ChildLimits limits{.seconds = 1};
  const ChildEnd end = RunInChild(limits, [] {
    for (;;) pause();
    return std::string();
  });
  EXPECT_EQ(Describe(end, limits), "does not end (1 s)");
}

TEST(ChildProcessTest, MemoryIsLimited) {
  const ChildLimits limits{.bytes = 1ull << 30};
  const ChildEnd end = RunInChild(limits, [] {
    std::vector<std::vector<char>> hoard;
    for (;;) hoard.emplace_back(1 << 24, 'x');
    return std::string();
  });
  EXPECT_EQ(Describe(end, limits), "out of memory (1 GiB)");
}

}  // namespace
}  // namespace treelight
