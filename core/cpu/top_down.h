#ifndef TREELIGHT_CORE_CPU_TOP_DOWN_H_
#define TREELIGHT_CORE_CPU_TOP_DOWN_H_

#include <atomic>
#include <bit>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "core/cpu/cancellation.h"
#include "core/cpu/loose_tree.h"
#include "tbb/parallel_invoke.h"

namespace treelight {

/// Photons of a subtree while it is split: places [first, last) of the leaf order. Splitters derive
/// from it what else they hand down.
struct PhotonRange {
  std::uint32_t first = 0, last = 0;
  std::uint32_t depth = 0;  ///< edges from the root

  std::uint32_t count() const { return last - first; }
};

/// The leaves that `count` photons fill.
inline std::uint32_t FullLeafCount(std::uint32_t count, std::uint32_t max_leaf_size) {
  return (count + max_leaf_size - 1) / max_leaf_size;
}

/// Photons left of a cut at the median, in steps of whole leaves. Halving so from any depth needs
/// ceil(log2(FullLeafCount)) more levels.
inline std::uint32_t WholeLeavesMedian(std::uint32_t count, std::uint32_t max_leaf_size) {
  return (FullLeafCount(count, max_leaf_size) + 1) / 2 * max_leaf_size;
}

/// Whether the subtree needs every level down to kMaxDepth even when it is halved from here on; so
/// a splitter that halves where this says so never makes a tree too deep, wherever it cuts before.
inline bool MustHalve(const PhotonRange& range, std::uint32_t max_leaf_size) {
  const std::uint32_t leaf_count = FullLeafCount(range.count(), max_leaf_size);
  return static_cast<std::uint32_t>(std::bit_width(leaf_count - 1)) + range.depth >= kMaxDepth;
}

/// Photon `id` of `positions` [3n] as trees hold it: -0 becomes +0.
inline LeafPhoton PhotonAt(const std::vector<float>& positions, std::uint32_t id) {
  const float* const p = &positions[3 * std::size_t{id}];
  return {p[0] + 0.0f, p[1] + 0.0f, p[2] + 0.0f, id};
}

/// Writes the photons `ids` of `positions`.
inline void PutPhotons(const std::vector<float>& positions, std::span<const std::uint32_t> ids,
                       LeafPhoton* to) {
  for (const std::uint32_t id : ids) *to++ = PhotonAt(positions, id);
}

/// All photons of `positions`, by index.
inline RawVector<LeafPhoton> AllPhotons(const std::vector<float>& positions) {
  RawVector<LeafPhoton> photons(positions.size() / 3);
  for (std::uint32_t id = 0; id < photons.size(); ++id) photons[id] = PhotonAt(positions, id);
  return photons;
}

/// Subtrees of fewer photons are built by one task.
inline constexpr std::uint32_t kTaskPhotons = 4096;

/// Splits ranges of more than `max_leaf_size` photons until there are none, in parallel. Nodes are
/// numbered as tasks come by, and lie close together; but for that the tree does not depend on the
/// number of tasks.
///
/// A Splitter has
///   Range                               derived from PhotonRange
///   std::pair<Range, Range> Split(const Range&)   left and right; neither is empty
///   void PutLeaf(const Range&, LeafPhoton*)   writes the photons of a leaf, in their order
/// each called for disjoint ranges from several threads at once.
template <typename Splitter>
class TopDown {
 public:
  using Range = typename Splitter::Range;

  /// Asks `cancellation` before each range that is worth a task is split.
  TopDown(std::uint32_t max_leaf_size, Splitter& splitter,
          const Cancellation& cancellation = kNotCancelled)
      : max_leaf_size_(max_leaf_size), splitter_(splitter), cancellation_(cancellation) {}

  /// Builds the tree over all photons, `root` being all of them. Of one that was cancelled there
  /// are parts, which nobody may look at.
  LooseTree Build(const Range& root) {
    if (root.count() == 0) return {};
    tree_.photons.resize(root.count());
    tree_.nodes.resize(root.count() - 1);
    tree_.root = BuildSubtree(root);
    tree_.nodes.resize(node_count_);
    return std::move(tree_);
  }

 private:
  Subtree BuildSubtree(const Range& range) {
    if (range.count() <= max_leaf_size_) return BuildLeaf(range);
    if (range.count() > kTaskPhotons && cancellation_.Ask()) return {};
    const std::pair<Range, Range> parts = splitter_.Split(range);
    Subtree left, right;
    if (range.count() > kTaskPhotons) {
      tbb::parallel_invoke([&] { left = BuildSubtree(parts.first); },
                           [&] { right = BuildSubtree(parts.second); });
    } else {
      left = BuildSubtree(parts.first);
      right = BuildSubtree(parts.second);
    }
    const std::uint32_t link = node_count_.fetch_add(1, std::memory_order_relaxed);
    tree_.nodes[link] = {left, right};
    return Join(link, left, right);
  }

  Subtree BuildLeaf(const Range& range) {
    splitter_.PutLeaf(range, &tree_.photons[range.first]);
    return MakeLeaf(tree_.photons, range.first, range.last);
  }

  const std::uint32_t max_leaf_size_;
  Splitter& splitter_;
  const Cancellation& cancellation_;
  LooseTree tree_;
  std::atomic<std::uint32_t> node_count_ = 0;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_TOP_DOWN_H_
