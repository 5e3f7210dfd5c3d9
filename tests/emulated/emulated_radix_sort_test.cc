// The kernels of radix_sort_onesweep.cl on the host (work_group.h), against std::stable_sort. Work-
// groups run one after the other, so that a tile finds those before it done: how tiles wait for
// each other is seen by radix_sort_test on a device that has sub-groups.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numeric>
#include <random>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/gpu/gpu.h"
#include "gtest/gtest.h"
#include "tests/emulated/radix_sort.h"
#include "tests/emulated/work_group.h"

namespace treelight::emulated {
namespace {

// As CMakeLists.txt has it.
static_assert(kSweepGroupSize == 12 * kSubGroupSize);
static_assert(kSweepItems<std::uint32_t> == 16 && kSweepItems<std::uint64_t> == 8);

constexpr std::size_t kDigits = 256;  // SWEEP_DIGITS

template <typename Key>
struct Pairs {
  std::vector<Key> keys;
  std::vector<std::uint32_t> values;
};

void Launch(void (*kernel)(const RadixSortArguments*), const RadixSortArguments& arguments,
            std::size_t groups, std::size_t group_size) {
  RunWorkGroups(groups, group_size / kSubGroupSize, [&] { kernel(&arguments); });
}

/// Sorts as core/gpu/radix_sort.cc does; not at all where `found` is above `most`.
template <typename Key>
Pairs<Key> Sort(Pairs<Key> pairs, unsigned key_bits, int found, int most) {
  constexpr bool kIsLong = std::is_same_v<Key, std::uint64_t>;
  const std::size_t n = pairs.keys.size(), tile = kSweepGroupSize * kSweepItems<Key>;
  const std::size_t tiles = (n + tile - 1) / tile, passes = (key_bits + 7) / 8;
  const std::size_t states_at = passes * (kDigits + 1);
  Pairs<Key> other{std::vector<Key>(n), std::vector<std::uint32_t>(n)};
  std::vector<std::uint32_t> sweep(states_at + passes * tiles * kDigits);
  RadixSortArguments arguments{};
  arguments.n = static_cast<uint>(n);
  arguments.pass_count = static_cast<uint>(passes);
  arguments.found = &found;
  arguments.most = most;
  arguments.sweep = sweep.data();
  arguments.keys = pairs.keys.data();
  Launch(kIsLong ? run_sweep_count_64 : run_sweep_count_32, arguments, 3, kGroupSize);
  for (std::size_t pass = 0; pass < passes; ++pass) {
    arguments.keys = pairs.keys.data();
    arguments.values = pairs.values.data();
    arguments.shift = static_cast<uint>(8 * pass);
    arguments.bins_at = static_cast<uint>(pass * kDigits);
    arguments.tiles_at = static_cast<uint>(passes * kDigits + pass);
    arguments.states_at = static_cast<uint>(states_at + pass * tiles * kDigits);
    arguments.keys_out = other.keys.data();
    arguments.values_out = other.values.data();
    Launch(kIsLong ? run_sweep_pass_64 : run_sweep_pass_32, arguments, tiles, kSweepGroupSize);
    std::swap(pairs, other);
  }
  return pairs;
}

template <typename Key>
void ExpectStableOrder(std::size_t n, Key mask, unsigned key_bits) {
  std::mt19937_64 random(n);
  Pairs<Key> pairs{std::vector<Key>(n), std::vector<std::uint32_t>(n)};
  for (Key& key : pairs.keys) key = static_cast<Key>(random()) & mask;
  std::iota(pairs.values.begin(), pairs.values.end(), 0u);
  const Pairs<Key> sorted = Sort(pairs, key_bits, /*found=*/5, /*most=*/5);
  std::vector<std::uint32_t> expected = pairs.values;
  std::stable_sort(expected.begin(), expected.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return pairs.keys[a] < pairs.keys[b]; });
  ASSERT_EQ(sorted.values, expected) << n << " keys of " << key_bits << " bits";
  for (std::size_t i = 0; i < n; ++i) ASSERT_EQ(sorted.keys[i], pairs.keys[expected[i]]) << i;
}

template <typename Key>
class EmulatedRadixSortTest : public testing::Test {};
using Keys = testing::Types<std::uint32_t, std::uint64_t>;
TYPED_TEST_SUITE(EmulatedRadixSortTest, Keys);

TYPED_TEST(EmulatedRadixSortTest, PairsAreInStableOrder) {
  constexpr TypeParam kAll = std::numeric_limits<TypeParam>::max();
  constexpr std::size_t kTile = kSweepGroupSize * kSweepItems<TypeParam>;
  for (const std::size_t n : {std::size_t{2}, kTile - 1, kTile, kTile + 1, std::size_t{20011}}) {
    ExpectStableOrder<TypeParam>(n, kAll, 8 * sizeof(TypeParam));
    ExpectStableOrder<TypeParam>(n, kAll >> 2, 8 * sizeof(TypeParam) - 2);
    ExpectStableOrder<TypeParam>(n, 0x0101, 16);  // four keys in all
    ExpectStableOrder<TypeParam>(n, 0, 8);
  }
}

TYPED_TEST(EmulatedRadixSortTest, NothingIsDoneWhereThereIsTooMuch) {
  const Pairs<TypeParam> pairs{{3, 2, 1}, {0, 1, 2}};
  // After an even number of passes what was there.
  EXPECT_EQ(Sort(pairs, 16, /*found=*/6, /*most=*/5).keys, pairs.keys);
  EXPECT_EQ(Sort(pairs, 16, /*found=*/5, /*most=*/5).values, (std::vector<std::uint32_t>{2, 1, 0}));
}

}  // namespace
}  // namespace treelight::emulated
