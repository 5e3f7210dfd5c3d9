#include <functional>
#include <stdexcept>
#include <string>

#include "core/builder.h"
#include "core/model/tree.h"
#include "gtest/gtest.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

/// A defect planted in a valid tree, and the words by which the validator names it.
struct Defect {
  const char* name;
  const char* message;
  std::function<void(Tree&)> plant;
};

class ValidateTest : public testing::TestWithParam<Defect> {};

TEST_P(ValidateTest, FindsThePlantedDefect) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 1000, /*seed=*/7);
  const auto map = TestBuilder().Build(photons, {});
  ASSERT_TRUE(map.ok()) << map.status();
  Tree tree = *(*map)->ReadTree();
  ASSERT_TRUE(ValidateTree(tree, photons).ok());
  GetParam().plant(tree);
  const absl::Status status = ValidateTree(tree, photons);
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
  EXPECT_NE(status.message().find(GetParam().message), std::string::npos) << status;
}

Node& NodeOverTwoLeaves(Tree& tree) {
  for (Node& node : tree.nodes) {
    if ((node.left & kLeafBit) != 0 && (node.right & kLeafBit) != 0) return node;
  }
  throw std::logic_error("no node has two leaves");
}

Node& NodeOverNode(Tree& tree) {
  for (Node& node : tree.nodes) {
    if ((node.left & kLeafBit) == 0) return node;
  }
  throw std::logic_error("no node has a node on its left");
}

INSTANTIATE_TEST_SUITE_P(
    Defects, ValidateTest,
    testing::Values(
        Defect{"LostPhoton", "invariant 1", [](Tree& tree) { tree.photons.pop_back(); }},
        Defect{"PhotonTwice", "two leaves", [](Tree& tree) { tree.photons[0] = tree.photons[1]; }},
        Defect{"MovedPhoton", "has moved", [](Tree& tree) { tree.photons[5].x += 1; }},
        Defect{"UnknownPhoton", "does not exist", [](Tree& tree) { tree.photons[5].id = 1000; }},
        Defect{"WrongCount", "claims", [](Tree& tree) { ++NodeOverNode(tree).left_count; }},
        Defect{"WrongSmallestId", "smallest photon", [](Tree& tree) { ++tree.min_ids[20]; }},
        Defect{"LooseBox", "not tight", [](Tree& tree) { tree.nodes[10].left_max[1] += 1; }},
        Defect{"Cycle", "two leaves",
               [](Tree& tree) { NodeOverTwoLeaves(tree).left = tree.root.link; }},
        Defect{"LargeLeaf", "invariant 4", [](Tree& tree) { tree.max_leaf_size = 8; }},
        Defect{"UnreachedNode", "are reached",
               [](Tree& tree) { tree.nodes.push_back(tree.nodes[0]); }}),
    [](const auto& suite) { return suite.param.name; });

TEST(ValidateTest, FindsOverlappingSiblings) {
  // Photons 0 and 2 in one leaf, 1 and 3 in the other, all on a line.
  Photons photons;
  for (int i = 0; i < 4; ++i)
    photons.positions.insert(photons.positions.end(), {static_cast<float>(i), 0, 0});
  Tree tree;
  tree.max_leaf_size = 2;
  tree.root = {{0, 0, 0}, {3, 0, 0}, 0, 4, 1};
  tree.photons = {{0, 0, 0, 0}, {2, 0, 0, 2}, {1, 0, 0, 1}, {3, 0, 0, 3}};
  tree.nodes = {{{0, 0, 0}, {2, 0, 0}, {1, 0, 0}, {3, 0, 0}, kLeafBit | 0, kLeafBit | 2, 2, 2}};
  tree.min_ids = {0, 1};
  // Both boxes are flat in y and z, where they touch: separable there, as touching is allowed.
  EXPECT_TRUE(ValidateTree(tree, photons).ok());
  for (int i = 0; i < 4; ++i)
    photons.positions[3 * i + 1] = photons.positions[3 * i + 2] = i % 4 < 2 ? 0.0f : 1.0f;
  for (LeafPhoton& p : tree.photons) p.y = p.z = p.id < 2 ? 0.0f : 1.0f;
  tree.root.max[1] = tree.root.max[2] = 1;
  for (int c = 1; c < 3; ++c) tree.nodes[0].left_max[c] = tree.nodes[0].right_max[c] = 1;
  const absl::Status status = ValidateTree(tree, photons);
  EXPECT_NE(status.message().find("invariant 3"), std::string::npos) << status;
  tree.kind = TreeKind::kBvh;
  EXPECT_TRUE(ValidateTree(tree, photons).ok());
}

TEST(ValidateTest, FindsADeepChain) {
  const std::uint32_t n = kMaxDepth + 2;
  Photons photons;
  Tree tree;
  tree.max_leaf_size = 1;
  for (std::uint32_t i = 0; i < n; ++i) {
    photons.positions.insert(photons.positions.end(), {static_cast<float>(i), 0, 0});
    tree.photons.push_back({static_cast<float>(i), 0, 0, i});
    if (i + 1 == n) break;
    const auto x = static_cast<float>(i), last = static_cast<float>(n - 1);
    const std::uint32_t right = i + 2 == n ? kLeafBit | (i + 1) : i + 1;
    tree.nodes.push_back(
        {{x, 0, 0}, {x, 0, 0}, {x + 1, 0, 0}, {last, 0, 0}, kLeafBit | i, right, 1, n - 1 - i});
    tree.min_ids.insert(tree.min_ids.end(), {i, i + 1});
  }
  tree.root = {{0, 0, 0}, {static_cast<float>(n - 1), 0, 0}, 0, n, n - 1};
  const absl::Status status = ValidateTree(tree, photons);
  EXPECT_NE(status.message().find("invariant 5"), std::string::npos) << status;
}

}  // namespace
}  // namespace treelight
