#include "core/cpu/gather_radius.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "tbb/parallel_for.h"

namespace treelight {
namespace {

std::uint32_t Hash(std::uint32_t input) {
  const std::uint32_t state = input * 747796405u + 2891336453u;
  const std::uint32_t word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737u;
  return (word >> 22) ^ word;
}

/// The squared distance to the k-th photon of a tree that has as many.
class KthDistance {
 public:
  KthDistance(const LooseTree& tree, const Vec3& center, std::uint32_t k)
      : tree_(tree), center_(center), k_(k) {}

  float Run() {
    Visit(tree_.root);
    return nearest_.front();
  }

 private:
  /// Whether one at this distance is nearer than the k-th so far.
  bool IsNearer(float squared_distance) const {
    return nearest_.size() < k_ || squared_distance < nearest_.front();
  }

  void Visit(const Subtree& subtree) {
    if (subtree.is_leaf()) {
      VisitLeaf(subtree);
      return;
    }
    std::array<std::pair<float, const Subtree*>, 2> children;
    for (int side = 0; side < 2; ++side) {
      const Subtree& child = tree_.nodes[subtree.link][side];
      children[side] = {BoxSquaredDistance(center_, child.box), &child};
    }
    if (children[1].first < children[0].first) std::swap(children[0], children[1]);
    for (const auto& [d2, child] : children) {
      if (IsNearer(d2)) Visit(*child);
    }
  }

  void VisitLeaf(const Subtree& leaf) {
    const LeafPhoton* const photons = &tree_.photons[leaf.link & ~kLeafBit];
    for (std::uint32_t i = 0; i < leaf.count; ++i) {
      const float d2 = SquaredDistance(center_, {photons[i].x, photons[i].y, photons[i].z});
      if (!IsNearer(d2)) continue;
      if (nearest_.size() == k_) {
        std::pop_heap(nearest_.begin(), nearest_.end());
        nearest_.pop_back();
      }
      nearest_.push_back(d2);
      std::push_heap(nearest_.begin(), nearest_.end());
    }
  }

  const LooseTree& tree_;
  const Vec3 center_;
  const std::uint32_t k_;
  std::vector<float> nearest_;  // squared distances, the farthest on top
};

}  // namespace

std::vector<std::uint32_t> SamplePhotons(std::uint32_t photon_count, std::uint32_t seed) {
  std::vector<std::uint32_t> ids;
  for (std::uint32_t i = 0; i < kRadiusSamples; ++i)
    ids.push_back(Hash(Hash(seed) + i) % photon_count);
  return ids;
}

float MedianRadius(std::vector<float> radii) {
  std::erase(radii, 0.0f);
  if (radii.empty()) return 0;
  const auto median = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), median, radii.end());
  return *median;
}

float SampleGatherRadius(const LooseTree& tree, const std::vector<float>& positions,
                         std::uint32_t seed) {
  const auto count = static_cast<std::uint32_t>(positions.size() / 3);
  if (count == 0) return 0;
  const std::vector<std::uint32_t> ids = SamplePhotons(count, seed);
  std::vector<float> radii(ids.size());
  tbb::parallel_for(std::size_t{0}, ids.size(), [&](std::size_t i) {
    const float* p = &positions[3 * std::size_t{ids[i]}];
    const std::uint32_t k = std::min(kRadiusNeighbors, count);
    radii[i] = std::sqrt(KthDistance(tree, {p[0], p[1], p[2]}, k).Run());
  });
  return MedianRadius(std::move(radii));
}

}  // namespace treelight
