#ifndef TREELIGHT_TESTS_TREE_KINDS_H_
#define TREELIGHT_TESTS_TREE_KINDS_H_

#include <cstring>
#include <string>
#include <vector>

#include "core/builder.h"

namespace treelight {

/// A builder with the options that tell its trees apart.
struct TreeKindOptions {
  std::string name;
  BuildOptions options;
};

/// Every kind of tree, each heuristic, each with and without the leaf term; leaves of 8.
inline std::vector<TreeKindOptions> AllTreeKinds() {
  using K = BuilderKind;
  using H = Heuristic;
  const auto none = LeafTerm::kNone;
  std::vector<TreeKindOptions> kinds = {
      {"lbvh", {.builder = K::kLbvh}},
      {"treelet_isa", {.builder = K::kTreelet}},
      {"treelet_sah", {.builder = K::kTreelet, .heuristic = H::kSah, .leaf_term = none}},
      {"treelet_vvh", {.builder = K::kTreelet, .heuristic = H::kVvh, .rounds = 2}},
      {"treelet_5", {.builder = K::kTreelet, .treelet_size = 5, .rounds = 1}},
      {"treelet_9", {.builder = K::kTreelet, .treelet_size = 9, .rounds = 1}},
      {"treelet_16", {.builder = K::kTreelet, .treelet_size = 16, .rounds = 1}},
      {"hybrid", {.builder = K::kHybrid}},
      {"hybrid_linear", {.builder = K::kHybrid, .leaf_term = none, .subtree_size = 1000}},
      {"trbvh_sah", {.builder = K::kTrbvh, .heuristic = H::kSah, .leaf_term = none}},
      {"trbvh_isa", {.builder = K::kTrbvh, .rounds = 1}},
      {"atrbvh", {.builder = K::kAtrbvh, .treelet_size = 9, .rounds = 2}},
      {"atrbvh_sah", {.builder = K::kAtrbvh, .heuristic = H::kSah, .leaf_term = none}},
      {"balanced", {.builder = K::kBalanced, .leaf_term = none}},
      {"balanced_whole_leaves", {.builder = K::kBalanced}},
      {"sah_linear", {.builder = K::kSweep, .heuristic = H::kSah, .leaf_term = none}},
      {"sah", {.builder = K::kSweep, .heuristic = H::kSah}},
      {"vvh", {.builder = K::kSweep, .heuristic = H::kVvh}},
      {"isa_linear", {.builder = K::kSweep, .leaf_term = none}},
      {"isa", {.builder = K::kSweep}},
      {"karras", {.builder = K::kKarras}},
  };
  for (TreeKindOptions& kind : kinds) kind.options.max_leaf_size = 8;
  return kinds;
}

/// Whether two trees are the same, bit by bit.
inline bool SameTree(const Tree& a, const Tree& b) {
  const auto same = [](const auto& u, const auto& v) {
    return u.size() == v.size() &&
           (u.empty() || std::memcmp(u.data(), v.data(), u.size() * sizeof u[0]) == 0);
  };
  const bool same_root = a.root.count == b.root.count &&
                         (a.root.count == 0 || std::memcmp(&a.root, &b.root, sizeof a.root) == 0);
  return same_root && same(a.nodes, b.nodes) && same(a.min_ids, b.min_ids) &&
         same(a.photons, b.photons);
}

}  // namespace treelight

#endif  // TREELIGHT_TESTS_TREE_KINDS_H_
