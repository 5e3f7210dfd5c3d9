#ifndef TREELIGHT_CORE_CPU_SIMD_PACKED_SEARCH_IMPL_H_
#define TREELIGHT_CORE_CPU_SIMD_PACKED_SEARCH_IMPL_H_

#include <bit>
#include <cstdint>
#include <limits>
#include <memory>

#include "core/cpu/simd/packed_search.h"
#include "core/cpu/simd/packed_tree.h"

// Included by one file for each kind of instructions and compiled for it, so all of it has internal
// linkage: what linkers may merge must not hold instructions that another processor lacks.
namespace treelight {
namespace {

/// Up to so many candidates are put in order by counting, for each, those before it.
constexpr std::uint32_t kRankedCandidates = 256;

/// From so many on, candidates are handed over.
constexpr std::uint32_t kTakenCandidates = 4096;

std::uint64_t KeyOf(float squared_distance, std::uint32_t id) {
  return std::uint64_t{std::bit_cast<std::uint32_t>(squared_distance)} << 32 | id;
}

std::uint32_t BitCount(std::uint32_t mask) {
  return static_cast<std::uint32_t>(__builtin_popcount(mask));
}

/// Calls `work(i)` for each bit i of `mask`, lowest first.
template <typename Work>
void ForEachBit(std::uint32_t mask, const Work& work) {
  for (; mask != 0; mask &= mask - 1) work(static_cast<std::uint32_t>(__builtin_ctz(mask)));
}

/// The query in all lanes. Distances are rounded as SquaredDistance rounds them.
template <typename L>
struct Center {
  using Floats = typename L::Floats;
  Floats q[3];

  explicit Center(const Vec3& center) : q{L::All(center.x), L::All(center.y), L::All(center.z)} {}

  static Floats SumOfSquares(Floats x, Floats y, Floats z) {
    return L::Add(L::Add(L::Multiply(x, x), L::Multiply(y, y)), L::Multiply(z, z));
  }

  /// To the boxes of the children: never above the distance to any photon of theirs.
  Floats ToBoxes(const PackedNode<L::kWidth>& node) const {
    return SumOfSquares(Outside(node, 0), Outside(node, 1), Outside(node, 2));
  }

  /// To the farthest corners of the boxes: never below the distance to any photon of theirs.
  Floats ToFarCorners(const PackedNode<L::kWidth>& node) const {
    return SumOfSquares(Across(node, 0), Across(node, 1), Across(node, 2));
  }

  /// To photons [place, place + W).
  Floats ToPhotons(const PackedView<L::kWidth>& tree, std::size_t place) const {
    return SumOfSquares(L::Subtract(q[0], L::Load(tree.x + place)),
                        L::Subtract(q[1], L::Load(tree.y + place)),
                        L::Subtract(q[2], L::Load(tree.z + place)));
  }

 private:
  Floats Outside(const PackedNode<L::kWidth>& node, int axis) const {
    return L::Max(L::Max(L::Subtract(L::Load(node.min[axis]), q[axis]),
                         L::Subtract(q[axis], L::Load(node.max[axis]))),
                  L::All(0));
  }
  Floats Across(const PackedNode<L::kWidth>& node, int axis) const {
    return L::Max(L::Subtract(q[axis], L::Load(node.min[axis])),
                  L::Subtract(L::Load(node.max[axis]), q[axis]));
  }
};

/// The lanes below `count`.
template <typename L>
typename L::Mask FirstLanes(std::uint32_t count) {
  return count >= L::kWidth ? (1u << L::kWidth) - 1 : (1u << count) - 1;
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

/// Enters every subtree that may hold one of the k.
struct EnterAll {
  static constexpr bool kLeavesOut = false;
};

/// Enters what an approximation asks for, and remembers the nearest of what it leaves out.
class EnterSome {
 public:
  static constexpr bool kLeavesOut = true;

  explicit EnterSome(const Approximation& approximation)
      : shrink_((1 + 0x1p-22f) / approximation.squared_stretch()),  // rounded up
        is_stretched_(approximation.epsilon > 0),
        leaves_left_(approximation.max_leaves > 0 ? approximation.max_leaves : kNoPhoton) {}

  /// How far subtrees are entered.
  template <typename L>
  float Reach(const Candidates<L>& candidates) const {
    if (leaves_left_ == 0) return -1;
    return is_stretched_ && candidates.is_full() ? candidates.limit() * shrink_
                                                 : candidates.limit();
  }
  void LeaveOut(float squared_distance) {
    given_up_ = squared_distance < given_up_ ? squared_distance : given_up_;
  }
  void CountLeaf() { --leaves_left_; }
  float given_up() const { return given_up_; }

 private:
  const float shrink_;
  const bool is_stretched_;
  std::uint32_t leaves_left_;
  float given_up_ = std::numeric_limits<float>::infinity();
};

template <typename L>
class LaneSearch final : public PackedSearch {
 public:
  explicit LaneSearch(const Tree& tree) : packed_(tree) {}

  FoundNearest FindNearest(const Vec3& center, std::uint32_t k, float limit,
                           SearchSpace& space) const override {
    return Search(center, k, limit, EnterAll(), space);
  }

  FoundNearest FindAboutNearest(const Vec3& center, std::uint32_t k, float limit,
                                const Approximation& approximation,
                                SearchSpace& space) const override {
    return Search(center, k, limit, EnterSome(approximation), space);
  }

  std::uint32_t FindWithin(const Vec3& center, float limit, SearchSpace& space,
                           const std::function<void(std::uint32_t)>& take) const override {
    return Collect(
        center, limit, [](const Node&, Mask) { return Mask{0}; }, space, take);
  }

  std::uint32_t FindWithinBeside(const Vec3& center, float limit,
                                 const std::function<bool(const WholeSubtree&)>& take_whole,
                                 SearchSpace& space,
                                 const std::function<void(std::uint32_t)>& take) const override {
    const Center<L> from(center);
    const View tree = packed_.view();
    const auto whole = [&](const Node& node, Mask near) {
      const auto far_d2 = from.ToFarCorners(node);
      Mask inside = near & L::LessEqual(far_d2, L::All(limit));
      if (inside == 0) return inside;
      alignas(64) float near_distances[L::kWidth], far_distances[L::kWidth];
      L::Store(from.ToBoxes(node), near_distances);
      L::Store(far_d2, far_distances);
      const std::uint32_t* const slots = tree.slots + (&node - tree.nodes) * L::kWidth;
      ForEachBit(inside, [&](std::uint32_t i) {
        const Box box = {{node.min[0][i], node.min[1][i], node.min[2][i]},
                         {node.max[0][i], node.max[1][i], node.max[2][i]}};
        if (!take_whole({slots[i], node.counts[i], box, near_distances[i], far_distances[i]})) {
          inside &= ~(Mask{1} << i);
        }
      });
      return inside;
    };
    return Collect(center, limit, whole, space, take);
  }

  std::uint32_t CountWithin(const Vec3& center, float limit) const override {
    std::uint32_t count = 0;
    const Center<L> from(center);
    const auto whole = [&](const Node& node, Mask near) {
      const Mask inside = near & L::LessEqual(from.ToFarCorners(node), L::All(limit));
      if (inside != 0) count += L::SumOf(L::Load(node.counts), inside);
      return inside;
    };
    const auto scan = [&](const View& tree, const Center<L>& at, std::uint32_t first,
                          std::uint32_t photon_count) {
      for (std::uint32_t i = 0; i < photon_count; i += L::kWidth) {
        count += BitCount(L::LessEqual(at.ToPhotons(tree, first + i), L::All(limit)) &
                          FirstLanes<L>(photon_count - i));
      }
    };
    WalkWithin(center, limit, whole, scan);
    return count;
  }

  void Sort(std::uint32_t count, SearchSpace& space) const override {
    if (count > kRankedCandidates || !SortByRank(count, space)) space.Sort(count);
  }

  std::size_t bytes() const override { return packed_.bytes(); }

 private:
  using View = PackedView<L::kWidth>;
  using Node = PackedNode<L::kWidth>;
  using Mask = typename L::Mask;

  /// A subtree that was not entered yet.
  struct Pending {
    std::uint64_t key;  ///< of its box and its smallest photon index
    std::uint32_t link, count;
  };

  /// A node leaves at most W - 1 others behind on each level.
  static constexpr std::uint32_t kStackSize = kMaxDepth * (L::kWidth - 1) + 1;

  template <typename Choice>
  FoundNearest Search(const Vec3& center, std::uint32_t k, float limit, Choice choice,
                      SearchSpace& space) const {
    Candidates<L> candidates(k, limit, space);
    const View tree = packed_.view();
    if (tree.count == 0) return {};
    const Center<L> from(center);
    Pending stack[kStackSize];
    std::uint32_t depth = 0;
    stack[depth++] = {0, tree.root, tree.count};
    while (depth > 0) {
      const Pending next = stack[--depth];
      if (next.key > candidates.limit_key()) continue;
      if constexpr (Choice::kLeavesOut) {
        const float d2 = std::bit_cast<float>(static_cast<std::uint32_t>(next.key >> 32));
        if (d2 > choice.Reach(candidates)) {
          choice.LeaveOut(d2);
          continue;
        }
      }
      if ((next.link & kLeafBit) != 0) {
        ScanNearest(tree, from, next.link & ~kLeafBit, next.count, candidates);
        if constexpr (Choice::kLeavesOut) choice.CountLeaf();
      } else {
        depth = PushChildren(tree.nodes[next.link], from, candidates, choice, stack, depth);
      }
    }
    FoundNearest found = candidates.Finish();
    if constexpr (Choice::kLeavesOut) found.given_up = choice.given_up();
    return found;
  }

  static void ScanNearest(const View& tree, const Center<L>& from, std::uint32_t first,
                          std::uint32_t photon_count, Candidates<L>& candidates) {
    for (std::uint32_t i = 0; i < photon_count; i += L::kWidth) {
      const auto d2 = from.ToPhotons(tree, first + i);
      const Mask mask =
          L::LessEqual(d2, L::All(candidates.limit())) & FirstLanes<L>(photon_count - i);
      if (mask != 0) candidates.Add(d2, tree.ids + first + i, mask);
    }
  }

  /// Pushes the children that are to be entered, the nearest last.
  template <typename Choice>
  static std::uint32_t PushChildren(const Node& node, const Center<L>& from,
                                    const Candidates<L>& candidates, Choice& choice, Pending* stack,
                                    std::uint32_t depth) {
    const auto d2 = from.ToBoxes(node);
    alignas(64) float distances[L::kWidth];
    L::Store(d2, distances);
    const std::uint32_t first = depth;
    Mask near = L::LessEqual(d2, L::All(candidates.limit()));
    if constexpr (Choice::kLeavesOut) {
      const Mask left_out = near & ~L::LessEqual(d2, L::All(choice.Reach(candidates)));
      ForEachBit(left_out, [&](std::uint32_t i) { choice.LeaveOut(distances[i]); });
      near ^= left_out;
    }
    ForEachBit(near, [&](std::uint32_t i) {
      const Pending child = {KeyOf(distances[i], node.min_ids[i]), node.links[i], node.counts[i]};
      std::uint32_t place = depth++;
      for (; place > first && stack[place - 1].key < child.key; --place) {
        stack[place] = stack[place - 1];
      }
      stack[place] = child;
    });
    return depth;
  }

  /// FindWithin without what `whole` takes, see WalkWithin.
  template <typename Whole>
  std::uint32_t Collect(const Vec3& center, float limit, const Whole& whole, SearchSpace& space,
                        const std::function<void(std::uint32_t)>& take) const {
    std::uint32_t count = 0;
    const auto scan = [&](const View& tree, const Center<L>& from, std::uint32_t first,
                          std::uint32_t photon_count) {
      if (take && count >= kTakenCandidates) {
        take(count);
        count = 0;
      }
      space.Reserve(count + photon_count);
      for (std::uint32_t i = 0; i < photon_count; i += L::kWidth) {
        const auto d2 = from.ToPhotons(tree, first + i);
        const auto mask = L::LessEqual(d2, L::All(limit)) & FirstLanes<L>(photon_count - i);
        L::Compress(d2, mask, space.squared_distances() + count);
        L::Compress(L::Load(tree.ids + first + i), mask, space.ids() + count);
        count += BitCount(mask);
      }
    };
    WalkWithin(center, limit, whole, scan);
    return count;
  }

  /// Walks all that is within `limit` but for the children that `whole(node, near)` takes; of
  /// blocks calls `scan(tree, from, first, count)`.
  template <typename Whole, typename Scan>
  void WalkWithin(const Vec3& center, float limit, const Whole& whole, const Scan& scan) const {
    const View tree = packed_.view();
    if (tree.count == 0) return;
    const Center<L> from(center);
    if ((tree.root & kLeafBit) != 0) {
      scan(tree, from, tree.root & ~kLeafBit, tree.count);
      return;
    }
    std::uint32_t stack[kStackSize];
    std::uint32_t depth = 0;
    stack[depth++] = tree.root;
    while (depth > 0) {
      const Node& node = tree.nodes[stack[--depth]];
      const Mask near = L::LessEqual(from.ToBoxes(node), L::All(limit));
      if (near == 0) continue;
      ForEachBit(near & ~whole(node, near), [&](std::uint32_t i) {
        if ((node.links[i] & kLeafBit) != 0) {
          scan(tree, from, node.links[i] & ~kLeafBit, node.counts[i]);
        } else {
          stack[depth++] = node.links[i];
        }
      });
    }
  }

  /// Puts each candidate at the place that is the number of those nearer. False, and nothing done,
  /// where two are at one distance.
  static bool SortByRank(std::uint32_t count, SearchSpace& space) {
    const float* const distances = space.squared_distances();
    const std::uint32_t* const ids = space.ids();
    float* const sorted_distances = space.spare_squared_distances();
    std::uint32_t* const sorted_ids = space.spare_ids();
    for (std::uint32_t i = 0; i < count; ++i) {
      const auto bound = L::All(distances[i]);
      std::uint32_t rank = 0, tied = 0;
      for (std::uint32_t j = 0; j < count; j += L::kWidth) {
        const auto others = L::Load(distances + j);
        const Mask lanes = FirstLanes<L>(count - j);
        const Mask up_to = L::LessEqual(others, bound) & lanes;
        const Mask nearer = L::Less(others, bound) & lanes;
        rank += BitCount(nearer);
        tied += BitCount(up_to ^ nearer);
      }
      if (tied > 1) return false;
      sorted_distances[rank] = distances[i];
      sorted_ids[rank] = ids[i];
    }
    space.SwapSpare();
    return true;
  }

  PackedTree<L::kWidth> packed_;
};

}  // namespace
}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SIMD_PACKED_SEARCH_IMPL_H_
