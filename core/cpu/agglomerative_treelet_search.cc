#include <limits>
#include <vector>

#include "core/cpu/treelet_search.h"

namespace treelight {
namespace {

class AgglomerativeTreeletSearch : public TreeletSearch {
 public:
  explicit AgglomerativeTreeletSearch(const TreeletCost& cost) : cost_(cost) {}

  TreeletPlan Find(std::span<const Subtree> leaves) override {
    TreeletPlan plan;
    clusters_.clear();
    for (const Subtree& leaf : leaves) {
      const auto number = static_cast<std::uint8_t>(clusters_.size());
      clusters_.push_back({leaf.box, leaf.count, leaf.cost, number});
    }
    while (clusters_.size() > 1) {
      const auto [a, b] = NearestPair();
      clusters_[a] = Merge(clusters_[a], clusters_[b], leaves.size(), plan);
      clusters_.erase(clusters_.begin() + static_cast<std::ptrdiff_t>(b));
    }
    plan.cost = clusters_[0].cost;
    return plan;
  }

 private:
  struct Cluster {
    Box box;
    std::uint32_t count;
    float cost;
    std::uint8_t number;  ///< as TreeletPlan has it
  };

  std::pair<std::size_t, std::size_t> NearestPair() const {
    std::pair<std::size_t, std::size_t> nearest{0, 1};
    float best = std::numeric_limits<float>::infinity();
    for (std::size_t a = 0; a < clusters_.size(); ++a) {
      for (std::size_t b = a + 1; b < clusters_.size(); ++b) {
        Box both = clusters_[a].box;
        both.Extend(clusters_[b].box);
        const float measure = cost_.measure(both);
        if (measure < best) {
          best = measure;
          nearest = {a, b};
        }
      }
    }
    return nearest;
  }

  Cluster Merge(const Cluster& a, const Cluster& b, std::size_t leaf_count,
                TreeletPlan& plan) const {
    Cluster both{a.box, a.count + b.count, 0,
                 static_cast<std::uint8_t>(leaf_count + plan.joint_count)};
    both.box.Extend(b.box);
    both.cost = cost_.Node(both.box, both.count, a.cost + b.cost).cost;
    plan.joints[plan.joint_count++] = {a.number, b.number};
    return both;
  }

  const TreeletCost cost_;
  std::vector<Cluster> clusters_;
};

}  // namespace

std::unique_ptr<TreeletSearch> MakeAgglomerativeTreeletSearch(const TreeletCost& cost) {
  return std::make_unique<AgglomerativeTreeletSearch>(cost);
}

}  // namespace treelight
