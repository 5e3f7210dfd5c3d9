// The work-groups of the emulation: that items meet, and that it is said where they do not.

#include "tests/emulated/work_group.h"

#include <algorithm>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <string>
#include <vector>

#include "gtest/gtest.h"

extern "C" {  // as the kernels see it
std::size_t emulated_local_id();
std::size_t emulated_group_id();
std::size_t emulated_group_count();
const std::uint32_t* emulated_exchange(std::uint32_t function, std::uint32_t value);
}

namespace treelight::emulated {
namespace {

constexpr std::uint32_t kBarrier = 1, kAny = 2, kOther = 3;

std::string FailureOf(std::size_t sub_groups, const std::function<void()>& item) {
  try {
    RunWorkGroups(1, sub_groups, item);
  } catch (const std::logic_error& error) {
    return error.what();
  }
  return "";
}

TEST(WorkGroupTest, ItemsSeeTheValuesOfTheirSubGroup) {
  std::vector<std::uint32_t> sums(96), runs(192);
  RunWorkGroups(2, 3, [&] {
    const std::size_t id = emulated_local_id();
    ASSERT_EQ(emulated_group_count(), 2u);
    ++runs[emulated_group_id() * 96 + id];
    for (std::uint32_t call = 0; call < 100; ++call) {
      const std::uint32_t* values = emulated_exchange(kAny, static_cast<std::uint32_t>(id) + call);
      for (std::uint32_t i = 0; i < 32; ++i) ASSERT_EQ(values[i], id / 32 * 32 + i + call);
      sums[id] += values[0];
    }
  });
  for (std::size_t id = 0; id < sums.size(); ++id)
    EXPECT_EQ(sums[id], 2 * (100 * (id / 32 * 32) + 4950));
  EXPECT_EQ(runs, std::vector<std::uint32_t>(192, 1));
}

TEST(WorkGroupTest, NoItemPassesABarrierBeforeAllHaveCome) {
  std::size_t come = 0;
  RunWorkGroups(1, 8, [&] {
    for (std::size_t round = 1; round <= 10; ++round) {
      if (emulated_local_id() < 32) emulated_exchange(kAny, 0);  // one sub-group is slower
      ++come;
      emulated_exchange(kBarrier, 0);
      ASSERT_EQ(come, 256 * round);
      emulated_exchange(kBarrier, 0);
    }
  });
  EXPECT_EQ(come, 2560u);
}

TEST(WorkGroupTest, EveryOrderOfTwoItemsHappens) {
  bool first_came_first = false, last_came_first = false;
  for (int i = 0; i < 10; ++i) {
    std::vector<std::size_t> order;
    RunWorkGroups(1, 1, [&] {
      emulated_exchange(kAny, 0);
      order.push_back(emulated_local_id());
    });
    const bool rises =
        std::find(order.begin(), order.end(), 0u) < std::find(order.begin(), order.end(), 31u);
    (rises ? first_came_first : last_came_first) = true;
  }
  EXPECT_TRUE(first_came_first && last_came_first);
}

TEST(WorkGroupTest, DivergenceIsSaid) {
  EXPECT_EQ(FailureOf(1, [] { emulated_exchange(kAny, 0); }), "");
  EXPECT_EQ(FailureOf(2, [] { emulated_exchange(emulated_local_id() == 40 ? kOther : kAny, 0); }),
            "items of a sub-group have diverged");
  EXPECT_EQ(FailureOf(1,
                      [] {
                        if (emulated_local_id() != 31) emulated_exchange(kAny, 0);
                      }),
            "items of a sub-group have diverged");
  EXPECT_EQ(FailureOf(2,
                      [] {
                        if (emulated_local_id() < 32) emulated_exchange(kBarrier, 0);
                      }),
            "sub-groups of a work-group have diverged");
}

}  // namespace
}  // namespace treelight::emulated
