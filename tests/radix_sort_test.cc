#include "core/gpu/radix_sort.h"

#include <algorithm>
#include <numeric>
#include <random>

#include "gtest/gtest.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

/// Sorts keys with the values 0, 1, 2, ... and compares with std::stable_sort by the lowest `bits`.
template <typename Key>
void CheckSort(const std::vector<Key>& keys, unsigned bits) {
  std::vector<cl_uint> values(keys.size());
  std::iota(values.begin(), values.end(), 0u);
  KeyValues<Key> pairs(TestGpu().memory(), keys.size());
  pairs.keys.Write(TestGpu().queue(), keys);
  pairs.values.Write(TestGpu().queue(), values);
  RadixSort(TestGpu(), pairs, keys.size(), bits);

  const Key mask = bits == 8 * sizeof(Key) ? ~Key{0} : (Key{1} << bits) - 1;
  std::stable_sort(values.begin(), values.end(),
                   [&](cl_uint a, cl_uint b) { return (keys[a] & mask) < (keys[b] & mask); });
  ASSERT_EQ(pairs.values.Read(TestGpu().queue()), values) << keys.size() << " " << bits;
  std::vector<Key> sorted;
  for (const cl_uint value : values) sorted.push_back(keys[value]);
  ASSERT_EQ(pairs.keys.Read(TestGpu().queue()), sorted) << keys.size() << " " << bits;
}

template <typename Key>
std::vector<Key> RandomKeys(std::size_t count, unsigned bits, unsigned seed) {
  std::mt19937_64 random(seed);
  std::vector<Key> keys(count);
  for (Key& key : keys) key = static_cast<Key>(random()) >> (8 * sizeof(Key) - bits);
  return keys;
}

TEST(RadixSortTest, KernelAgreesWithStableSort) {
  for (const std::size_t size : kSizes) {
    for (const unsigned bits : {1u, 8u, 30u, 32u})
      CheckSort<cl_uint>(RandomKeys<cl_uint>(size, bits, 7), bits);
    for (const unsigned bits : {30u, 45u, 63u, 64u})
      CheckSort<cl_ulong>(RandomKeys<cl_ulong>(size, bits, 7), bits);
  }
}

TEST(RadixSortTest, SortedReversedAndEqualKeys) {
  std::vector<cl_uint> ascending(70001);
  std::iota(ascending.begin(), ascending.end(), 0u);
  CheckSort<cl_uint>(ascending, 32);
  CheckSort<cl_uint>({ascending.rbegin(), ascending.rend()}, 32);
  CheckSort<cl_uint>(std::vector<cl_uint>(70001, 0xffffffffu), 32);
  CheckSort<cl_ulong>(std::vector<cl_ulong>(70001, ~cl_ulong{0}), 64);
}

TEST(RadixSortTest, ASortIsSparedByALargeNumberAlone) {
  for (const unsigned bits : {8u, 16u, 30u}) {  // an odd number of passes, and even ones
    const auto keys = RandomKeys<cl_uint>(20011, bits, 7);
    std::vector<cl_uint> values(keys.size());
    std::iota(values.begin(), values.end(), 0u);
    for (const cl_int found : {-5, 10, 11}) {
      KeyValues<cl_uint> pairs(TestGpu().memory(), keys.size());
      pairs.keys.Write(TestGpu().queue(), keys);
      pairs.values.Write(TestGpu().queue(), values);
      RadixSort(TestGpu(), pairs, keys.size(), bits, {Upload<cl_int>({found}), 10});
      std::vector<cl_uint> expected = keys;
      if (found <= 10) std::sort(expected.begin(), expected.end());
      EXPECT_EQ(pairs.keys.Read(TestGpu().queue()), expected) << bits << " " << found;
      EXPECT_EQ(pairs.values.Read(TestGpu().queue()) == values, found > 10) << bits << " " << found;
    }
  }
}

TEST(RadixSortTest, FreshKeysAgreeWithStableSort) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  CheckSort<cl_uint>(RandomKeys<cl_uint>(54321, 12, seed), 12);  // many equal keys
  CheckSort<cl_ulong>(RandomKeys<cl_ulong>(54321, 63, seed), 63);
}

}  // namespace
}  // namespace treelight
