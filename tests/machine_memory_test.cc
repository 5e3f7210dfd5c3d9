#include "core/machine_memory.h"

#include <unistd.h>

#include <fstream>
#include <string>

#include "gtest/gtest.h"
#include "server/memory_limit.h"
#include "tests/temporary_folder.h"

namespace treelight {
namespace {

/// A root folder with the files that a test writes.
class MachineMemoryTest : public ::testing::Test {
 protected:
  void Write(const std::string& file, const std::string& text) {
    std::filesystem::create_directories((root_ / file).parent_path());
    std::ofstream(root_ / file) << text;
  }

  testing::TemporaryFolder temporary_;
  const std::filesystem::path root_ = temporary_.path();
};

TEST_F(MachineMemoryTest, IsWhatTheMachineHasWithoutGroups) {
  Write("proc/meminfo", "MemFree:  7 kB\nMemTotal:       2048 kB\nCached: 5 kB\n");
  EXPECT_EQ(MachineMemoryBytes(root_), 2048u << 10);
  EXPECT_EQ(server::DefaultMemoryLimit(root_), 1024u << 10);
}

TEST_F(MachineMemoryTest, IsTheLeastOfItsGroupsOfVersion2) {
  Write("proc/meminfo", "MemTotal: 2048 kB\n");
  Write("proc/self/cgroup", "0::/outer/inner\n");
  Write("sys/fs/cgroup/outer/memory.max", "1000000\n");
  Write("sys/fs/cgroup/outer/inner/memory.max", "max\n");
  EXPECT_EQ(MachineMemoryBytes(root_), 1'000'000u);
  Write("sys/fs/cgroup/outer/inner/memory.max", "500000\n");
  EXPECT_EQ(MachineMemoryBytes(root_), 500'000u);
}

TEST_F(MachineMemoryTest, InAContainerTheMountIsTheGroup) {
  Write("proc/meminfo", "MemTotal: 2048 kB\n");
  Write("proc/self/cgroup", "0::/\n");
  Write("sys/fs/cgroup/memory.max", "300000\n");
  EXPECT_EQ(MachineMemoryBytes(root_), 300'000u);
}

TEST_F(MachineMemoryTest, KnowsGroupsOfVersion1) {
  Write("proc/meminfo", "MemTotal: 2048 kB\n");
  Write("proc/self/cgroup", "4:cpu,cpuacct:/a\n3:memory:/a\n");
  Write("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
  Write("sys/fs/cgroup/memory/a/memory.limit_in_bytes", "400000\n");
  EXPECT_EQ(MachineMemoryBytes(root_), 400'000u);
}

TEST_F(MachineMemoryTest, UnknownMemoryHasALimitStill) {
  EXPECT_EQ(MachineMemoryBytes(root_), 0u);
  EXPECT_EQ(server::DefaultMemoryLimit(root_), std::uint64_t{4} << 30);
}

TEST_F(MachineMemoryTest, ThisMachineHasSome) { EXPECT_GT(MachineMemoryBytes(), 1u << 20); }

}  // namespace
}  // namespace treelight
