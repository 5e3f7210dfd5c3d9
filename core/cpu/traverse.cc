#include "core/cpu/traverse.h"

#include <algorithm>
#include <limits>

namespace treelight {
namespace {

/// A child on the way: where it is, and what its parent knows of it.
struct Child {
  std::uint32_t link, count, min_id;
  float squared_distance;  ///< of its box
};

/// Squared distance to the farthest corner of the box.
float FarSquaredDistance(const Vec3& q, const Box& box) {
  const float dx = std::max(q.x - box.min.x, box.max.x - q.x);
  const float dy = std::max(q.y - box.min.y, box.max.y - q.y);
  const float dz = std::max(q.z - box.min.z, box.max.z - q.z);
  return (dx * dx + dy * dy) + dz * dz;
}

Child ChildOnTheWay(const TreeChild& child, const Vec3& q) {
  return {child.link, child.count, child.min_id, BoxSquaredDistance(q, child.box)};
}

Candidate CandidateOf(const Vec3& q, const LeafPhoton& photon) {
  return {SquaredDistance(q, {photon.x, photon.y, photon.z}), photon.id};
}

class NearestSearch {
 public:
  NearestSearch(const Tree& tree, const Vec3& center, std::uint32_t k, float radius,
                const Approximation& approximation)
      : tree_(tree),
        center_(center),
        k_(k),
        squared_radius_(radius * radius),
        squared_stretch_(approximation.squared_stretch()),
        leaves_left_(approximation.max_leaves > 0 ? approximation.max_leaves : kNoPhoton) {
    answer_.limit = radius;
  }

  QueryAnswer Run() {
    const Root& root = tree_.root;
    const float d2 = root.count > 0 ? BoxSquaredDistance(center_, MakeBox(root.min, root.max)) : 0;
    if (root.count > 0 && d2 <= squared_radius_) Visit({root.link, root.count, 0, d2});
    std::sort(answer_.found.begin(), answer_.found.end());
    answer_.error_bound = NearestErrorBound(
        IsFull(), IsFull() ? answer_.found.back().squared_distance : 0, given_up_);
    return std::move(answer_);
  }

 private:
  bool IsFull() const { return answer_.found.size() == k_; }

  /// Whether a candidate counts: what is within the radius, then what beats the k-th.
  bool Beats(const Candidate& candidate) const {
    return IsFull() ? candidate < answer_.found.front()
                    : candidate.squared_distance <= squared_radius_;
  }

  /// Whether a subtree is to be entered; remembers the nearest that might have been, and is not.
  bool IsWorthwhile(const Child& child) {
    if (!Beats({child.squared_distance, child.min_id})) return false;
    const float stretched = child.squared_distance * squared_stretch_;
    if (leaves_left_ > 0 && (!IsFull() || Beats({stretched, child.min_id}))) return true;
    given_up_ = std::min(given_up_, child.squared_distance);
    return false;
  }

  void Visit(const Child& child) {
    ++answer_.nodes_visited;
    if ((child.link & kLeafBit) != 0) {
      VisitLeaf(child);
      return;
    }
    const auto [left, right] = ChildrenOf(tree_, child.link);
    Child near = ChildOnTheWay(left, center_);
    Child far = ChildOnTheWay(right, center_);
    if (std::pair(far.squared_distance, far.min_id) <
        std::pair(near.squared_distance, near.min_id)) {
      std::swap(near, far);
    }
    if (IsWorthwhile(near)) Visit(near);
    if (IsWorthwhile(far)) Visit(far);
  }

  void VisitLeaf(const Child& leaf) {
    --leaves_left_;
    answer_.distance_tests += leaf.count;
    std::vector<Candidate>& heap = answer_.found;  // the worst on top
    const LeafPhoton* photons = &tree_.photons[leaf.link & ~kLeafBit];
    for (std::uint32_t i = 0; i < leaf.count; ++i) {
      const Candidate candidate = CandidateOf(center_, photons[i]);
      if (!Beats(candidate)) continue;
      if (IsFull()) {
        std::pop_heap(heap.begin(), heap.end());
        heap.pop_back();
      }
      heap.push_back(candidate);
      std::push_heap(heap.begin(), heap.end());
    }
  }

  const Tree& tree_;
  const Vec3 center_;
  const std::uint32_t k_;
  const float squared_radius_;
  const float squared_stretch_;
  std::uint32_t leaves_left_;
  float given_up_ = std::numeric_limits<float>::infinity();  // squared distance
  QueryAnswer answer_;
};

class RangeSearch {
 public:
  RangeSearch(const Tree& tree, const Vec3& center, float radius, WholeSubtrees whole,
              const SumOptions* sums = nullptr)
      : tree_(tree), center_(center), squared_radius_(radius * radius), whole_(whole), sums_(sums) {
    answer_.limit = radius;
    if (sums != nullptr) answer_.summed.emplace();
  }

  QueryAnswer Run() {
    const Root& root = tree_.root;
    if (root.count > 0) {
      const float d2 = BoxSquaredDistance(center_, MakeBox(root.min, root.max));
      Visit({root.link, root.count, 0, d2}, /*inside=*/false);
    }
    std::sort(answer_.found.begin(), answer_.found.end());
    return std::move(answer_);
  }

 private:
  /// @param inside  the photons below are listed, but no visits are counted
  void Visit(const Child& child, bool inside) {
    if (child.squared_distance > squared_radius_) return;
    if (!inside) ++answer_.nodes_visited;
    if ((child.link & kLeafBit) != 0) {
      if (!inside) answer_.distance_tests += child.count;
      const LeafPhoton* photons = &tree_.photons[child.link & ~kLeafBit];
      for (std::uint32_t i = 0; i < child.count; ++i) {
        const Candidate candidate = CandidateOf(center_, photons[i]);
        if (candidate.squared_distance > squared_radius_) continue;
        answer_.found.push_back(candidate);
        if (answer_.summed && !inside) answer_.summed->apart.push_back(candidate);
      }
      return;
    }
    std::size_t slot = 2 * std::size_t{child.link};
    for (const TreeChild& below : ChildrenOf(tree_, child.link)) {
      Visit(ChildOnTheWay(below, center_), inside || IsInside(below.box) || IsSummed(below, slot));
      ++slot;
    }
  }

  bool IsInside(const Box& box) const {
    return whole_ == WholeSubtrees::kCounted && FarSquaredDistance(center_, box) <= squared_radius_;
  }

  /// Adds up a subtree by its moments, where that may be.
  bool IsSummed(const TreeChild& subtree, std::size_t slot) {
    if (sums_ == nullptr) return false;
    const float far = FarSquaredDistance(center_, subtree.box);
    if (!(far <= squared_radius_) || squared_radius_ == 0) return false;
    const auto weight =
        Linearise(sums_->kernel, BoxSquaredDistance(center_, subtree.box) / squared_radius_,
                  far / squared_radius_);
    if (weight.error > sums_->weight_tolerance * PeakWeight(sums_->kernel)) return false;
    const auto whole = SumOf(sums_->moments[slot], subtree.box, center_, answer_.limit, weight);
    for (std::size_t c = 0; c < 3; ++c) answer_.summed->sums[c] += whole.sums[c];
    answer_.summed->error += whole.error;
    return true;
  }

  const Tree& tree_;
  const Vec3 center_;
  const float squared_radius_;
  const WholeSubtrees whole_;
  const SumOptions* const sums_;
  QueryAnswer answer_;
};

}  // namespace

QueryAnswer FindNearest(const Tree& tree, const Vec3& center, std::uint32_t k, float radius,
                        const Approximation& approximation) {
  return NearestSearch(tree, center, k, radius, approximation).Run();
}

QueryAnswer FindWithin(const Tree& tree, const Vec3& center, float radius, WholeSubtrees whole) {
  return RangeSearch(tree, center, radius, whole).Run();
}

QueryAnswer SumWithin(const Tree& tree, const Vec3& center, float radius,
                      const SumOptions& options) {
  return RangeSearch(tree, center, radius, WholeSubtrees::kVisited, &options).Run();
}

}  // namespace treelight
