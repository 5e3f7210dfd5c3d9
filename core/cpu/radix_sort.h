#ifndef TREELIGHT_CORE_CPU_RADIX_SORT_H_
#define TREELIGHT_CORE_CPU_RADIX_SORT_H_

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/cpu/cancellation.h"
#include "tbb/parallel_for.h"
#include "tbb/task_arena.h"

namespace treelight {

/// Sorts `items` by the lowest `bits` bits of `key(item)`, an unsigned number; items of equal keys
/// stay in their order. Least significant digit first; each pass counts and moves parts of the
/// items in parallel. Cancelled between passes, it leaves all items, in another order.
/// @param items  a std::vector of plain values
/// @param spare  of any size; used as the other half of the memory
template <typename Items, typename Key>
void RadixSort(Items& items, Items& spare, unsigned bits, const Key& key,
               const Cancellation& cancellation = kNotCancelled) {
  using Item = typename Items::value_type;
  constexpr unsigned kMinDigitBits = 6, kMaxDigitBits = 11;
  constexpr std::size_t kMinPart = 1 << 14;
  using Counts = std::array<std::uint32_t, 1 << kMaxDigitBits>;

  spare.resize(items.size());
  // Few items are not worth many digits: about as many as items.
  const auto size_bits = static_cast<unsigned>(std::bit_width(items.size()));
  const unsigned most_bits = std::clamp(size_bits, kMinDigitBits + 1, kMaxDigitBits + 1) - 1;
  const unsigned passes = std::max(1u, (bits + most_bits - 1) / most_bits);
  const unsigned digit_bits = (bits + passes - 1) / passes;
  const std::uint32_t digits = 1u << digit_bits;
  const auto threads = static_cast<std::size_t>(tbb::this_task_arena::max_concurrency());
  const std::size_t parts = std::clamp<std::size_t>(items.size() / kMinPart, 1, threads);
  std::vector<Counts> places(parts);
  for (unsigned shift = 0; shift < bits && !cancellation.Ask(); shift += digit_bits) {
    const auto digit = [&](const Item& item) {
      return static_cast<std::uint32_t>(key(item) >> shift) & (digits - 1);
    };
    const auto for_each_part = [&](const auto& work) {
      const auto run = [&](std::size_t part) {
        const Item* const first = items.data() + items.size() * part / parts;
        const Item* const last = items.data() + items.size() * (part + 1) / parts;
        work(places[part], first, last);
      };
      if (parts == 1) {
        run(0);
      } else {
        tbb::parallel_for(std::size_t{0}, parts, run);
      }
    };
    for_each_part([&](Counts& counts, const Item* item, const Item* last) {
      std::fill_n(counts.begin(), digits, 0u);
      for (; item < last; ++item) ++counts[digit(*item)];
    });
    std::uint32_t place = 0;
    for (std::uint32_t d = 0; d < digits; ++d) {
      for (Counts& counts : places) {
        const std::uint32_t count = counts[d];
        counts[d] = place;
        place += count;
      }
    }
    for_each_part([&](Counts& next, const Item* item, const Item* last) {
      for (; item < last; ++item) spare[next[digit(*item)]++] = *item;
    });
    items.swap(spare);
  }
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_RADIX_SORT_H_
