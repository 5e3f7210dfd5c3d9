#include "core/model/power_moments.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace treelight {
namespace {

/// Moments of one channel about a point, in scene units.
struct Channel {
  double sum = 0, x = 0, y = 0, z = 0, square = 0, absolute = 0;

  void Add(double power, double dx, double dy, double dz) {
    sum += power;
    x += power * dx;
    y += power * dy;
    z += power * dz;
    square += power * (dx * dx + dy * dy + dz * dz);
    absolute += std::fabs(power);
  }

  /// Adds what is known about a point that is (dx, dy, dz) away.
  void AddMoved(const Channel& other, double dx, double dy, double dz) {
    sum += other.sum;
    x += other.x + other.sum * dx;
    y += other.y + other.sum * dy;
    z += other.z + other.sum * dz;
    square += other.square + 2 * (dx * other.x + dy * other.y + dz * other.z) +
              other.sum * (dx * dx + dy * dy + dz * dz);
    absolute += other.absolute;
  }
};

using Channels = std::array<Channel, 3>;

class MomentsOf {
 public:
  MomentsOf(const Tree& tree, const std::vector<float>& powers, std::vector<PowerMoments>& moments)
      : tree_(tree), powers_(powers), moments_(moments) {}

  /// Of a subtree about the middle of its box; stores those of all children below.
  Channels Visit(const TreeChild& subtree) {
    const Vec3 middle = MomentsCenter(subtree.box);
    Channels channels;
    if ((subtree.link & kLeafBit) != 0) {
      const LeafPhoton* const first = &tree_.photons[subtree.link & ~kLeafBit];
      for (const LeafPhoton* photon = first; photon < first + subtree.count; ++photon) {
        const float* const power = &powers_[3 * std::size_t{photon->id}];
        for (std::size_t c = 0; c < 3; ++c) {
          channels[c].Add(power[c], double{photon->x} - middle.x, double{photon->y} - middle.y,
                          double{photon->z} - middle.z);
        }
      }
      return channels;
    }
    std::size_t slot = 2 * std::size_t{subtree.link};
    for (const TreeChild& child : ChildrenOf(tree_, subtree.link)) {
      const Channels below = Visit(child);
      Store(below, child.box, moments_[slot++]);
      const Vec3 at = MomentsCenter(child.box);
      for (std::size_t c = 0; c < 3; ++c) {
        channels[c].AddMoved(below[c], double{at.x} - middle.x, double{at.y} - middle.y,
                             double{at.z} - middle.z);
      }
    }
    return channels;
  }

 private:
  static void Store(const Channels& channels, const Box& box, PowerMoments& moments) {
    const double unit = MomentsUnit(box);
    const double scale = unit > 0 ? 1 / unit : 0;
    double absolute = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const Channel& from = channels[c];
      const double values[] = {from.sum, from.x * scale, from.y * scale, from.z * scale,
                               from.square * scale * scale};
      for (std::size_t i = 0; i < 5; ++i) moments.channels[c][i] = static_cast<float>(values[i]);
      absolute = std::max(absolute, from.absolute);
    }
    moments.absolute = static_cast<float>(absolute);
  }

  const Tree& tree_;
  const std::vector<float>& powers_;
  std::vector<PowerMoments>& moments_;
};

}  // namespace

std::vector<PowerMoments> ComputeMoments(const Tree& tree, const std::vector<float>& powers) {
  std::vector<PowerMoments> moments(2 * tree.nodes.size());
  const Root& root = tree.root;
  if (root.count == 0 || (root.link & kLeafBit) != 0) return moments;
  MomentsOf(tree, powers, moments)
      .Visit({.box = MakeBox(root.min, root.max), .link = root.link, .count = root.count});
  return moments;
}

}  // namespace treelight
