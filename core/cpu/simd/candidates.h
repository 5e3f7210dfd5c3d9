#ifndef TREELIGHT_CORE_CPU_SIMD_CANDIDATES_H_
#define TREELIGHT_CORE_CPU_SIMD_CANDIDATES_H_

#include <bit>
#include <cstdint>

#include "core/cpu/simd/lane_masks.h"
#include "core/cpu/simd/packed_search.h"

// Included by one file for each kind of instructions and compiled for it, so all of it has internal
// linkage: what linkers may merge must not hold instructions that another processor lacks.
namespace treelight {
namespace {

std::uint64_t KeyOf(float squared_distance, std::uint32_t id) {
  return std::uint64_t{std::bit_cast<std::uint32_t>(squared_distance)} << 32 | id;
}

/// Candidates in the arrays of a space, of which the k best are kept.
template <typename L>
class Candidates {
 public:
  Candidates(std::uint32_t k, float limit, SearchSpace& space) : k_(k), space_(space) {
    space.Reserve(full_ + L::kWidth);
    SetLimit(limit, kNoPhoton);
    distances_ = space.squared_distances();
    ids_ = space.ids();
  }

  /// Nothing beyond is among the k nearest.
  float limit() const { return limit_; }
  std::uint64_t limit_key() const { return limit_key_; }

  /// Whether k are known, none of them beyond the limit.
  bool is_full() const { return is_full_; }

  void Add(typename L::Floats squared_distances, const std::uint32_t* ids, typename L::Mask mask) {
    L::Compress(squared_distances, mask, distances_ + count_);
    L::Compress(L::Load(ids), mask, ids_ + count_);
    count_ += BitCount(mask);
    if (count_ > full_) KeepBest();
  }

  FoundNearest Finish() {
    if (count_ > k_) KeepBest();
    float farthest = 0;
    for (std::uint32_t i = 0; i < count_; ++i) {
      farthest = distances_[i] > farthest ? distances_[i] : farthest;
    }
    return {count_, farthest};
  }

 private:
  void SetLimit(float limit, std::uint32_t id) {
    limit_ = limit;
    limit_key_ = KeyOf(limit, id);
  }

  /// How many are at `bound` or nearer.
  std::uint32_t CountUpTo(float bound) const {
    const auto bounds = L::All(bound);
    std::uint32_t count = 0;
    for (std::uint32_t i = 0; i < count_; i += L::kWidth) {
      count += BitCount(L::LessEqual(L::Load(distances_ + i), bounds) & FirstLanes<L>(count_ - i));
    }
    return count;
  }

  /// Keeps the k best of more than k: halves the range of the bound, in steps of the bits of a
  /// float, until exactly k are within it, or it is the distance of several between which the ids
  /// decide.
  void KeepBest() {
    is_full_ = true;
    std::uint32_t low = 0, high = std::bit_cast<std::uint32_t>(limit_);
    bool exact = false;
    while (low < high) {
      const std::uint32_t middle = low + (high - low) / 2;
      const std::uint32_t count = CountUpTo(std::bit_cast<float>(middle));
      if (count < k_) {
        low = middle + 1;
      } else {
        high = middle;
        if (count == k_) {
          exact = true;
          break;
        }
      }
    }
    const float bound = std::bit_cast<float>(high);
    if (exact) {
      MoveToFront(bound);
      SetLimit(bound, kNoPhoton);
    } else {
      KeepBestOfTies(bound);
    }
  }

  /// Fewer than k are nearer than `bound`, and more than k are not farther.
  void KeepBestOfTies(float bound) {
    float* const distances = distances_;
    std::uint32_t* const ids = ids_;
    // Those at the bound behind those nearer.
    std::uint32_t nearer = 0, tied = 0;
    std::uint32_t* const tied_ids = space_.spare_ids();
    for (std::uint32_t i = 0; i < count_; ++i) {
      if (distances[i] < bound) {
        distances[nearer] = distances[i];
        ids[nearer++] = ids[i];
      } else if (distances[i] == bound) {
        tied_ids[tied++] = ids[i];
      }
    }
    for (std::uint32_t i = 0; i < tied; ++i) ids[nearer + i] = tied_ids[i];
    space_.KeepSmallestIds(nearer, tied, k_ - nearer);
    std::uint32_t largest = 0;
    for (std::uint32_t i = nearer; i < k_; ++i) {
      distances[i] = bound;
      largest = ids[i] > largest ? ids[i] : largest;
    }
    count_ = k_;
    SetLimit(bound, largest);
  }

  /// Keeps those at `bound` or nearer.
  void MoveToFront(float bound) {
    const auto bounds = L::All(bound);
    std::uint32_t kept = 0;
    for (std::uint32_t i = 0; i < count_; i += L::kWidth) {
      const auto distances = L::Load(distances_ + i);
      const auto ids = L::Load(ids_ + i);
      const auto mask = L::LessEqual(distances, bounds) & FirstLanes<L>(count_ - i);
      L::Compress(distances, mask, distances_ + kept);
      L::Compress(ids, mask, ids_ + kept);
      kept += BitCount(mask);
    }
    count_ = kept;
  }

  const std::uint32_t k_;
  // Sorting out costs as much as there are candidates, so it waits for as many again as are kept.
  const std::uint32_t full_ = 2 * k_ + L::kWidth;
  SearchSpace& space_;
  float* distances_;
  std::uint32_t* ids_;
  std::uint32_t count_ = 0;
  float limit_ = 0;
  std::uint64_t limit_key_ = 0;
  bool is_full_ = false;
};

/// Sorts candidates by (squared distance, id): puts each at the place that is the number of those
/// before it. False, and nothing done, where many are at one distance.
template <typename L>
bool SortByRank(std::uint32_t count, SearchSpace& space) {
  const float* const distances = space.squared_distances();
  const std::uint32_t* const ids = space.ids();
  float* const sorted_distances = space.spare_squared_distances();
  std::uint32_t* const sorted_ids = space.spare_ids();
  std::uint32_t ties_left = count / 8;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto bound = L::All(distances[i]);
    std::uint32_t rank = 0, tied = 0;
    for (std::uint32_t j = 0; j < count; j += L::kWidth) {
      const auto others = L::Load(distances + j);
      const typename L::Mask lanes = FirstLanes<L>(count - j);
      const typename L::Mask up_to = L::LessEqual(others, bound) & lanes;
      const typename L::Mask nearer = L::Less(others, bound) & lanes;
      rank += BitCount(nearer);
      tied += BitCount(up_to ^ nearer);
    }
    if (tied > 1) {
      if (ties_left-- == 0) return false;
      for (std::uint32_t j = 0; j < count; ++j) {
        const bool is_tied = distances[j] == distances[i], is_smaller = ids[j] < ids[i];
        rank += static_cast<std::uint32_t>(is_tied & is_smaller);
      }
    }
    sorted_distances[rank] = distances[i];
    sorted_ids[rank] = ids[i];
  }
  space.SwapSpare();
  return true;
}

}  // namespace
}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SIMD_CANDIDATES_H_
