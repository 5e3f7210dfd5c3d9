#ifndef TREELIGHT_CORE_CPU_SIMD_PACKED_SEARCH_IMPL_H_
#define TREELIGHT_CORE_CPU_SIMD_PACKED_SEARCH_IMPL_H_

#include <bit>
#include <cstdint>
#include <limits>
#include <memory>

#include "core/cpu/simd/candidates.h"
#include "core/cpu/simd/center.h"
#include "core/cpu/simd/lane_masks.h"
#include "core/cpu/simd/packed_search.h"
#include "core/cpu/simd/packed_tree.h"

// Included by one file for each kind of instructions and compiled for it, so all of it has internal
// linkage: what linkers may merge must not hold instructions that another processor lacks.
namespace treelight {
namespace {

/// Up to so many vectors of candidates are put in order by counting, for each, those before it.
constexpr std::uint32_t kRankedVectors = 16;

/// From so many on, candidates are handed over.
constexpr std::uint32_t kTakenCandidates = 4096;

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
    if (count > kRankedVectors * L::kWidth || !SortByRank<L>(count, space)) space.Sort(count);
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

  PackedTree<L::kWidth> packed_;
};

}  // namespace
}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SIMD_PACKED_SEARCH_IMPL_H_
