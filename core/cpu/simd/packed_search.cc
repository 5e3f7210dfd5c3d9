#include "core/cpu/simd/packed_search.h"

#include <algorithm>
#include <bit>

namespace treelight {
namespace {

// Stored vectors may reach so far beyond the last candidate.
constexpr std::uint32_t kVectorSpace = 16;

}  // namespace

void SearchSpace::Reserve(std::uint32_t count) {
  if (count <= capacity_) return;
  capacity_ = std::bit_ceil(count);
  const std::size_t size = std::size_t{capacity_} + kVectorSpace;
  for (auto* distances : {&squared_distances_, &spare_squared_distances_}) distances->resize(size);
  for (auto* ids : {&ids_, &spare_ids_}) ids->resize(size);
}

void SearchSpace::KeepSmallestIds(std::uint32_t first, std::uint32_t count, std::uint32_t keep) {
  const auto ids = ids_.begin() + first;
  std::nth_element(ids, ids + keep, ids + count);
}

void SearchSpace::Sort(std::uint32_t count) {
  keys_.resize(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    keys_[i] = std::uint64_t{std::bit_cast<std::uint32_t>(squared_distances_[i])} << 32 | ids_[i];
  }
  std::sort(keys_.begin(), keys_.end());
  for (std::uint32_t i = 0; i < count; ++i) {
    squared_distances_[i] = std::bit_cast<float>(static_cast<std::uint32_t>(keys_[i] >> 32));
    ids_[i] = static_cast<std::uint32_t>(keys_[i]);
  }
}

void SearchSpace::SwapSpare() {
  squared_distances_.swap(spare_squared_distances_);
  ids_.swap(spare_ids_);
}

std::string_view NameOf(Instructions instructions) {
  switch (instructions) {
    case Instructions::kPlain:
      return "plain C++";
    case Instructions::kAvx2:
      return "AVX2";
    case Instructions::kAvx512:
      return "AVX-512";
  }
  return "unknown";
}

std::vector<Instructions> SupportedInstructions() {
  std::vector<Instructions> supported = {Instructions::kPlain};
#ifdef __x86_64__
  if (__builtin_cpu_supports("avx2")) supported.push_back(Instructions::kAvx2);
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw")) {
    supported.push_back(Instructions::kAvx512);
  }
#endif
  return supported;
}

std::unique_ptr<PackedSearch> MakePackedSearch(const Tree& tree, Instructions instructions) {
  switch (instructions) {
#ifdef __x86_64__
    case Instructions::kAvx512:
      return MakeAvx512Search(tree);
    case Instructions::kAvx2:
      return MakeAvx2Search(tree);
#endif
    default:
      return MakePlainSearch(tree);
  }
}

}  // namespace treelight
