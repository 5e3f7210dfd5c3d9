#include "core/cpu/treelet.h"

#include <algorithm>
#include <limits>
#include <memory>

#include "core/cpu/top_down.h"
#include "tbb/enumerable_thread_specific.h"
#include "tbb/parallel_invoke.h"

namespace treelight {
namespace {

/// A few nodes at the top of a subtree.
struct Treelet {
  std::vector<Subtree> leaves;
  std::vector<std::uint32_t> nodes;  ///< [leaves - 1] the first is the root
};

/// What one thread works with.
struct Workshop {
  std::unique_ptr<TreeletSearch> search;
  Treelet treelet;
  std::vector<Subtree> parts;
};

std::unique_ptr<TreeletSearch> MakeSearch(TreeletMethod method, const TreeletCost& cost) {
  switch (method) {
    case TreeletMethod::kKdTree:
      return MakeKdTreeletSearch(cost);
    case TreeletMethod::kBvh:
      return MakeBvhTreeletSearch(cost);
    case TreeletMethod::kAgglomerative:
      return MakeAgglomerativeTreeletSearch(cost);
  }
  return nullptr;
}

class Restructurer {
 public:
  Restructurer(LooseTree& tree, const TreeletCost& cost, const TreeletOptions& options,
               const Cancellation& cancellation)
      : tree_(tree), cost_(cost), options_(options), cancellation_(cancellation), workshops_([=] {
          return Workshop{MakeSearch(options.method, cost), {}, {}};
        }) {}

  void Run() {
    for (round_ = 0; round_ < options_.rounds && !cancellation_.stopped(); ++round_) {
      tree_.root = Visit(tree_.root, 0);
    }
  }

 private:
  /// Restructures a subtree bottom-up and returns what it is now.
  Subtree Visit(Subtree subtree, std::uint32_t depth) {
    if (subtree.is_leaf()) {
      subtree.cost = cost_.MayMerge(subtree.count) ? cost_.Leaf(subtree.box, subtree.count) : 0.0f;
      return subtree;
    }
    if (subtree.count > kTaskPhotons && cancellation_.Ask()) return subtree;
    Subtree& left = tree_.nodes[subtree.link][0];
    Subtree& right = tree_.nodes[subtree.link][1];
    if (subtree.count > kTaskPhotons) {
      tbb::parallel_invoke([&] { left = Visit(left, depth + 1); },
                           [&] { right = Visit(right, depth + 1); });
    } else {
      left = Visit(left, depth + 1);
      right = Visit(right, depth + 1);
    }
    const Subtree finished = JoinWithCost(subtree.link, left, right);
    const bool is_treelet_root =
        finished.leaf_count >= options_.treelet_size || (depth == 0 && finished.leaf_count > 2);
    return is_treelet_root ? Improve(finished, depth) : finished;
  }

  /// Cost of two siblings; infinite where they may not be siblings: what no plane separates can
  /// still be one leaf.
  float Parts(const Subtree& left, float left_cost, const Subtree& right, float right_cost) const {
    if (options_.method == TreeletMethod::kKdTree && !Separable(left.box, right.box)) {
      return std::numeric_limits<float>::infinity();
    }
    return left_cost + right_cost;
  }

  Subtree JoinWithCost(std::uint32_t link, const Subtree& left, const Subtree& right) const {
    Subtree both = Join(link, left, right);
    if (cost_.MayMerge(both.count)) {
      const auto choice =
          cost_.Node(both.box, both.count, Parts(left, left.cost, right, right.cost));
      both.cost = choice.cost;
      both.merged = choice.merged;
    }
    return both;
  }

  Subtree Improve(const Subtree& root, std::uint32_t depth) {
    Workshop& workshop = workshops_.local();
    Form(root.link, workshop.treelet);
    const TreeletPlan plan = workshop.search->Find(workshop.treelet.leaves);
    const float old_cost = CostNow(root, workshop.treelet);
    if (!(plan.cost < old_cost * (1 - kTreeletGain))) return root;
    Assemble(plan, workshop.treelet, workshop.parts);
    if (workshop.parts.back().height + depth > kMaxDepth) return root;
    Commit(plan, workshop.treelet, workshop.parts);
    return workshop.parts.back();
  }

  /// What a treelet grows by.
  float Priority(const Subtree& subtree) const {
    return round_ % 2 == 0 ? cost_.measure(subtree.box) : static_cast<float>(subtree.count);
  }

  /// Grows the treelet below node `root`.
  void Form(std::uint32_t root, Treelet& treelet) const {
    const auto& [left, right] = tree_.nodes[root];
    treelet.leaves = {left, right};
    treelet.nodes = {root};
    while (treelet.leaves.size() < options_.treelet_size) {
      std::size_t largest = treelet.leaves.size();
      float largest_priority = -1;
      for (std::size_t i = 0; i < treelet.leaves.size(); ++i) {
        if (treelet.leaves[i].is_leaf()) continue;
        const float priority = Priority(treelet.leaves[i]);
        if (priority > largest_priority) {
          largest_priority = priority;
          largest = i;
        }
      }
      if (largest == treelet.leaves.size()) break;  // all are leaves of the tree
      const std::uint32_t node = treelet.leaves[largest].link;
      treelet.nodes.push_back(node);
      treelet.leaves[largest] = tree_.nodes[node][0];
      treelet.leaves.push_back(tree_.nodes[node][1]);
    }
  }

  /// The cost of the treelet as it is, summed as a search sums it.
  float CostNow(const Subtree& subtree, const Treelet& treelet) const {
    const auto& nodes = treelet.nodes;
    if (subtree.is_leaf() || std::find(nodes.begin(), nodes.end(), subtree.link) == nodes.end()) {
      return subtree.cost;
    }
    const auto& [left, right] = tree_.nodes[subtree.link];
    const float parts = Parts(left, CostNow(left, treelet), right, CostNow(right, treelet));
    return cost_.Node(subtree.box, subtree.count, parts).cost;
  }

  /// The node that joint `j` of a plan takes; the last joint is the root and stays it.
  static std::uint32_t NodeOf(const Treelet& treelet, std::size_t j) {
    return treelet.nodes[treelet.nodes.size() - 1 - j];
  }

  /// Lists the leaves and joints of the plan as subtrees.
  void Assemble(const TreeletPlan& plan, const Treelet& treelet,
                std::vector<Subtree>& parts) const {
    parts = treelet.leaves;
    for (std::uint32_t j = 0; j < plan.joint_count; ++j) {
      const TreeletPlan::Joint& joint = plan.joints[j];
      parts.push_back(JoinWithCost(NodeOf(treelet, j), parts[joint.left], parts[joint.right]));
    }
  }

  void Commit(const TreeletPlan& plan, const Treelet& treelet, const std::vector<Subtree>& parts) {
    for (std::uint32_t j = 0; j < plan.joint_count; ++j) {
      const TreeletPlan::Joint& joint = plan.joints[j];
      tree_.nodes[NodeOf(treelet, j)] = {parts[joint.left], parts[joint.right]};
    }
  }

  LooseTree& tree_;
  const TreeletCost cost_;
  const TreeletOptions options_;
  const Cancellation& cancellation_;
  std::uint32_t round_ = 0;
  tbb::enumerable_thread_specific<Workshop> workshops_;
};

}  // namespace

void RestructureTreelets(LooseTree& tree, const TreeletCost& cost, const TreeletOptions& options,
                         const Cancellation& cancellation) {
  if (tree.photons.empty() || tree.root.is_leaf()) return;
  Restructurer(tree, cost, options, cancellation).Run();
}

}  // namespace treelight
