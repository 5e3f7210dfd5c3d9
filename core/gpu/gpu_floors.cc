#include "core/gpu/gpu_floors.h"

#include <algorithm>
#include <mutex>
#include <random>
#include <utility>
#include <vector>

#include "core/device/guard.h"
#include "core/device/stage_timer.h"
#include "core/gpu/radix_sort.h"
#include "core/kernels/types.h"

namespace treelight {
namespace {

template <typename Key>
double TimeSort(const Gpu& gpu, std::size_t count, unsigned key_bits) {
  std::mt19937_64 random(count);
  std::vector<Key> keys(count);
  for (Key& key : keys) key = static_cast<Key>(random() >> (64 - key_bits));
  KeyValues<Key> pairs(gpu.memory(), count);
  pairs.keys.Write(gpu.queue(), keys);
  pairs.values.Fill(gpu.queue(), 0);
  gpu.queue().finish();
  StageTimer timer(gpu.queue());
  RadixSort(gpu, pairs, count, key_bits);
  timer.Mark("sort");
  const double us = timer.Finish().front().microseconds;
  if (!std::ranges::is_sorted(pairs.keys.Read(gpu.queue(), count))) {
    throw StatusError(absl::InternalError("radix sort: keys not in order"));
  }
  return us;
}

class GpuFloorMeter : public FloorMeter {
 public:
  explicit GpuFloorMeter(Gpu gpu) : gpu_(std::move(gpu)) {}

  absl::StatusOr<Floors> Measure(std::size_t count) override {
    const std::lock_guard lock(gpu_.device->mutex());
    return Guard([&]() -> absl::StatusOr<Floors> {
      Floors floors;
      floors.sort_32_us = TimeSort<cl_uint>(gpu_, count, 30);
      floors.sort_64_us = TimeSort<cl_ulong>(gpu_, count, 63);
      const Buffer<LeafPhoton> from(gpu_.memory(), count), to(gpu_.memory(), count);
      floors.copy_bytes = from.bytes();
      if (count == 0) return floors;
      from.Fill(gpu_.queue(), LeafPhoton{});  // so that their pages are there
      to.Fill(gpu_.queue(), LeafPhoton{});
      gpu_.queue().finish();
      StageTimer timer(gpu_.queue());
      gpu_.queue().enqueueCopyBuffer(from.get(), to.get(), 0, 0, from.bytes());
      timer.Mark("copy");
      floors.copy_us = timer.Finish().front().microseconds;
      return floors;
    });
  }

 private:
  const Gpu gpu_;
};

}  // namespace

std::unique_ptr<FloorMeter> MakeGpuFloorMeter(Gpu gpu) {
  return std::make_unique<GpuFloorMeter>(std::move(gpu));
}

}  // namespace treelight
