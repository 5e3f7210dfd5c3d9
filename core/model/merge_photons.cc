#include "core/model/merge_photons.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "core/model/facing_balance.h"
#include "core/model/finite_float.h"

namespace treelight {
namespace {

class Merger {
 public:
  Merger(const Tree& tree, const Photons& photons, std::uint32_t group_size)
      : tree_(tree), photons_(photons), group_size_(group_size) {}

  Photons Run() {
    const Root& root = tree_.root;
    if (root.count == 0) return {};
    std::vector<TreeChild> pending = {
        {.box = MakeBox(root.min, root.max), .link = root.link, .count = root.count}};
    while (!pending.empty()) {
      const TreeChild subtree = pending.back();
      pending.pop_back();
      if ((subtree.link & kLeafBit) != 0 || subtree.count <= group_size_) {
        const auto first = tree_.photons.begin() + FirstPhoton(subtree.link);
        group_.assign(first, first + subtree.count);
        Cut(group_);
        continue;
      }
      const auto [left, right] = ChildrenOf(tree_, subtree.link);
      pending.push_back(right);
      pending.push_back(left);
    }
    return std::move(merged_);
  }

 private:
  std::uint32_t FirstPhoton(std::uint32_t link) const {
    while ((link & kLeafBit) == 0) link = tree_.nodes[link].left;
    return link & ~kLeafBit;
  }

  /// Cuts a leaf until it may be merged.
  void Cut(std::span<LeafPhoton> group) {
    if (group.size() <= group_size_) return Merge(group);
    const int axis = WidestAxis(group);
    const auto key = [axis](const LeafPhoton& photon) {
      return axis == 0 ? photon.x : axis == 1 ? photon.y : photon.z;
    };
    const std::size_t half = group.size() / 2;
    std::nth_element(group.begin(), group.begin() + static_cast<std::ptrdiff_t>(half), group.end(),
                     [&](const LeafPhoton& a, const LeafPhoton& b) {
                       return key(a) < key(b) || (key(a) == key(b) && a.id < b.id);
                     });
    Cut(group.first(half));
    Cut(group.subspan(half));
  }

  static Box BoxOf(std::span<const LeafPhoton> group) {
    Box box;
    for (const LeafPhoton& photon : group) box.Extend(Vec3{photon.x, photon.y, photon.z});
    return box;
  }

  static int WidestAxis(std::span<const LeafPhoton> group) {
    const Box box = BoxOf(group);
    int widest = 0;
    for (int axis = 1; axis < 3; ++axis) {
      const auto side = [&](int a) { return Component(box.max, a) - Component(box.min, a); };
      if (side(axis) > side(widest)) widest = axis;
    }
    return widest;
  }

  const float* PowerOf(const LeafPhoton& photon) const {
    return &photons_.powers[3 * std::size_t{photon.id}];
  }

  double WeightOf(const LeafPhoton& photon) const {
    const float* const power = PowerOf(photon);
    return double{std::fabs(power[0])} + std::fabs(power[1]) + std::fabs(power[2]);
  }

  void Merge(std::span<const LeafPhoton> group) {
    double total = 0, powers[3] = {}, sums[3] = {}, plain[3] = {};
    for (const LeafPhoton& photon : group) {
      const double weight = WeightOf(photon);
      const float at[3] = {photon.x, photon.y, photon.z};
      total += weight;
      for (int c = 0; c < 3; ++c) {
        powers[c] += PowerOf(photon)[c];
        sums[c] += weight * at[c];
        plain[c] += at[c];
      }
    }
    const Box box = BoxOf(group);
    for (int axis = 0; axis < 3; ++axis) {
      const double middle =
          total > 0 ? sums[axis] / total : plain[axis] / static_cast<double>(group.size());
      merged_.positions.push_back(std::clamp(static_cast<float>(middle), Component(box.min, axis),
                                             Component(box.max, axis)));
      merged_.powers.push_back(FiniteFloat(powers[axis]));
    }
    if (photons_.directions.empty()) return;
    const std::uint32_t chosen = Represent(group);
    for (std::size_t i = 0; i < 2; ++i) {
      merged_.directions.push_back(photons_.directions[2 * std::size_t{chosen} + i]);
    }
  }

  /// The photon of the group whose direction all of it gets.
  std::uint32_t Represent(std::span<const LeafPhoton> group) {
    members_.clear();
    for (const LeafPhoton& photon : group) {
      const std::int16_t* const direction = &photons_.directions[2 * std::size_t{photon.id}];
      members_.push_back(
          {.id = photon.id, .weight = WeightOf(photon), .faces = balance_.FacesOf(direction)});
    }
    return balance_.Choose(members_);
  }

  const Tree& tree_;
  const Photons& photons_;
  const std::uint32_t group_size_;
  std::vector<LeafPhoton> group_;
  std::vector<GroupMember> members_;
  FacingBalance balance_;
  Photons merged_;
};

}  // namespace

Photons MergePhotons(const Tree& tree, const Photons& photons, std::uint32_t group_size) {
  return Merger(tree, photons, group_size).Run();
}

}  // namespace treelight
