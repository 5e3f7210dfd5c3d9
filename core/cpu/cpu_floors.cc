#include "core/cpu/cpu_floors.h"

#include <algorithm>
#include <chrono>
#include <random>
#include <vector>

#include "core/cpu/radix_sort.h"
#include "core/model/tree.h"
#include "tbb/blocked_range.h"
#include "tbb/parallel_for.h"

namespace treelight {
namespace {

template <typename Code>
struct Coded {
  Code code;
  std::uint32_t id;
};

template <typename Work>
double Microseconds(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::micro>(std::chrono::steady_clock::now() - start)
      .count();
}

template <typename Code>
absl::StatusOr<double> TimeSort(std::size_t count, unsigned bits) {
  std::mt19937_64 random(count);
  std::vector<Coded<Code>> pairs(count), spare(count);
  for (std::size_t i = 0; i < count; ++i) {
    pairs[i] = {static_cast<Code>(random() >> (64 - bits)), static_cast<std::uint32_t>(i)};
  }
  const auto code = [](const Coded<Code>& pair) { return pair.code; };
  const double us = Microseconds([&] { RadixSort(pairs, spare, bits, code); });
  if (!std::ranges::is_sorted(pairs, {}, code)) return absl::InternalError("pairs not in order");
  return us;
}

class CpuFloorMeter : public FloorMeter {
 public:
  absl::StatusOr<Floors> Measure(std::size_t count) override {
    Floors floors;
    const auto sort_32 = TimeSort<std::uint32_t>(count, 30);
    if (!sort_32.ok()) return sort_32.status();
    floors.sort_32_us = *sort_32;
    const auto sort_64 = TimeSort<std::uint64_t>(count, 63);
    if (!sort_64.ok()) return sort_64.status();
    floors.sort_64_us = *sort_64;
    const std::vector<LeafPhoton> from(count);
    std::vector<LeafPhoton> to(count);  // written once: its pages are there
    constexpr std::size_t kPart = 1 << 16;
    floors.copy_us = Microseconds([&] {
      tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, kPart), [&](const auto& part) {
        std::copy_n(from.data() + part.begin(), part.size(), to.data() + part.begin());
      });
    });
    floors.copy_bytes = count * sizeof(LeafPhoton);
    return floors;
  }
};

}  // namespace

std::unique_ptr<FloorMeter> MakeCpuFloorMeter() { return std::make_unique<CpuFloorMeter>(); }

}  // namespace treelight
