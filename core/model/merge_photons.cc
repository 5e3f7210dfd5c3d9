#include "core/model/merge_photons.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace treelight {
namespace {

/// The place of a direction along a curve over the sphere that passes those of one octant, and of
/// a part of it, one after the other: the Morton code of its octahedral coordinates.
std::uint32_t CurvePlace(const std::int16_t* direction) {
  const auto spread = [](std::int16_t coordinate) {
    auto bits = static_cast<std::uint32_t>(coordinate + 32768);
    bits = (bits | bits << 8) & 0x00ff00ffu;
    bits = (bits | bits << 4) & 0x0f0f0f0fu;
    bits = (bits | bits << 2) & 0x33333333u;
    return (bits | bits << 1) & 0x55555555u;
  };
  return spread(direction[0]) << 1 | spread(direction[1]);
}

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

  void Merge(std::span<LeafPhoton> group) {
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
      merged_.powers.push_back(static_cast<float>(powers[axis]));
    }
    if (photons_.directions.empty()) return;
    const std::uint32_t drawn = Draw(group, total);
    for (std::size_t i = 0; i < 2; ++i) {
      merged_.directions.push_back(photons_.directions[2 * std::size_t{drawn} + i]);
    }
  }

  /// The index of a photon of the group, drawn with its weight along the curve, by a golden-ratio
  /// sequence over the groups: of neighbouring groups together, each part of the sphere gets nearly
  /// its share.
  std::uint32_t Draw(std::span<LeafPhoton> group, double total) {
    const auto place = [this](const LeafPhoton& photon) {
      return std::pair(CurvePlace(&photons_.directions[2 * std::size_t{photon.id}]), photon.id);
    };
    std::ranges::sort(group, {}, place);
    constexpr double kGoldenRatio = 0.6180339887498949;
    draw_ += kGoldenRatio;
    draw_ -= std::floor(draw_);
    double left = draw_ * total;
    for (const LeafPhoton& photon : group) {
      left -= WeightOf(photon);
      if (left < 0) return photon.id;
    }
    return group.back().id;
  }

  const Tree& tree_;
  const Photons& photons_;
  const std::uint32_t group_size_;
  std::vector<LeafPhoton> group_;
  double draw_ = 0;  // [0, 1)
  Photons merged_;
};

}  // namespace

Photons MergePhotons(const Tree& tree, const Photons& photons, std::uint32_t group_size) {
  return Merger(tree, photons, group_size).Run();
}

}  // namespace treelight
