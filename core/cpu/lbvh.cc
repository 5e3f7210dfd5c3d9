#include "core/cpu/lbvh.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/cpu/bounds.h"
#include "core/cpu/median.h"
#include "core/cpu/radix_sort.h"
#include "core/model/morton.h"
#include "tbb/parallel_for.h"

namespace treelight {
namespace {

// Codes of ties end at this level at most: below remain 35 for medians and places.
constexpr std::uint32_t kLastCodeLevel = 93;

/// As many cells along each axis, whatever its extent.
MortonGrid PerAxisGrid(const Box& bounds, unsigned bits_per_axis) {
  MortonGrid grid = MakeMortonGrid(bounds, bits_per_axis);
  const float cells = std::exp2(static_cast<float>(bits_per_axis));
  for (int axis = 0; axis < 3; ++axis) {
    const float extent = Component(bounds.max, axis) - Component(bounds.min, axis);
    const float scale = cells / (extent * grid.prescale);
    grid.scale[axis] = std::isfinite(scale) ? scale : 0.0f;
  }
  return grid;
}

/// Cubic cells with a scale that is a power of two, half to all of 1024 along the longest edge.
MortonGrid PowerOfTwoGrid(const Box& box) {
  const float longest =
      std::max({box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z});
  MortonGrid grid{};
  grid.prescale = longest < 0x1p-60f ? 0x1p96f : 1.0f;
  int exponent = 0;
  std::frexp(longest * grid.prescale, &exponent);
  for (int axis = 0; axis < 3; ++axis) {
    grid.min[axis] = Component(box.min, axis);
    grid.scale[axis] = std::ldexp(1.0f, 10 - exponent);
  }
  return grid;
}

}  // namespace

LbvhSplitter::LbvhSplitter(const std::vector<float>& positions, MortonBits bits,
                           MortonLayout layout, std::uint32_t max_leaf_size,
                           const Cancellation& cancellation)
    : positions_(positions),
      layout_(layout),
      max_leaf_size_(max_leaf_size),
      code_bits_(static_cast<std::uint32_t>(bits)),
      cancellation_(cancellation),
      ids_(positions.size() / 3),
      codes_(positions.size() / 3),
      cut_levels_(positions.size() / 3) {
  tbb::parallel_for(std::size_t{0}, ids_.size(),
                    [&](std::size_t i) { ids_[i] = static_cast<std::uint32_t>(i); });
  const Box bounds = BoundsOf(positions);
  const unsigned bits_per_axis = code_bits_ / 3;
  SortByCodes(Root(),
              layout == MortonLayout::kCubic ? MakeMortonGrid(bounds, bits_per_axis)
                                             : PerAxisGrid(bounds, bits_per_axis),
              bits_per_axis);
}

LbvhSplitter::Range LbvhSplitter::Root() const {
  return {{0, static_cast<std::uint32_t>(ids_.size()), 0}, code_bits_};
}

Vec3 LbvhSplitter::PositionOf(std::uint32_t id) const {
  const float* p = &positions_[3 * std::size_t{id}];
  return {p[0] + 0.0f, p[1] + 0.0f, p[2] + 0.0f};
}

void LbvhSplitter::SortByCodes(const PhotonRange& range, const MortonGrid& grid,
                               unsigned bits_per_axis) {
  if (3 * bits_per_axis <= 32) {
    SortBy<std::uint32_t>(range, grid, bits_per_axis);
  } else {
    SortBy<std::uint64_t>(range, grid, bits_per_axis);
  }
}

template <typename Code>
void LbvhSplitter::SortBy(const PhotonRange& range, const MortonGrid& grid,
                          unsigned bits_per_axis) {
  struct CodedPhoton {
    Code code;
    std::uint32_t id;
  };
  RawVector<CodedPhoton> photons(range.count()), spare;
  tbb::parallel_for(0u, range.count(), [&](std::uint32_t i) {
    const std::uint32_t id = ids_[range.first + i];
    photons[i] = {MortonCode<Code>(PositionOf(id), grid, bits_per_axis), id};
  });
  const auto code = [](const CodedPhoton& photon) { return photon.code; };
  if (range.count() > kTaskPhotons) {
    RadixSort(photons, spare, 3 * bits_per_axis, code, cancellation_);
  } else {
    std::stable_sort(photons.begin(), photons.end(),
                     [](const CodedPhoton& a, const CodedPhoton& b) { return a.code < b.code; });
  }
  tbb::parallel_for(0u, range.count(), [&](std::uint32_t i) {
    ids_[range.first + i] = photons[i].id;
    codes_[range.first + i] = photons[i].code;
  });
}

LbvhSplitter::Cut LbvhSplitter::CutByPlace(const PhotonRange& range) {
  // The boundary whose two places differ in the highest bit.
  const std::uint32_t last = range.last - 1, difference = range.first ^ last;
  const auto level = static_cast<std::uint32_t>(std::countl_zero(difference));
  return {last & ~(std::bit_floor(difference) - 1), kLevelIndex + level};
}

LbvhSplitter::Cut LbvhSplitter::FindCodeCut(const Range& range) const {
  const std::uint64_t bit = std::bit_floor(codes_[range.first] ^ codes_[range.last - 1]);
  const auto begin = codes_.begin() + range.first, end = codes_.begin() + range.last;
  const auto cut =
      std::partition_point(begin, end, [bit](std::uint64_t code) { return (code & bit) == 0; });
  return {static_cast<std::uint32_t>(cut - codes_.begin()),
          range.level - static_cast<std::uint32_t>(std::bit_width(bit))};
}

LbvhSplitter::Cut LbvhSplitter::CutTies(Range& range) {
  if (layout_ == MortonLayout::kPerAxis) return CutByPlace(range);
  Box box;
  for (const std::uint32_t id : LeafIds(range)) box.Extend(PositionOf(id));
  if (box.min == box.max) return CutByPlace(range);
  if (range.level + kTieBits <= kLastCodeLevel) {
    SortByCodes(range, PowerOfTwoGrid(box), kTieBits / 3);
    range.level += kTieBits;
    return FindCodeCut(range);
  }
  const int axis = WidestAxis(box);
  std::stable_sort(ids_.begin() + range.first, ids_.begin() + range.last,
                   [&](std::uint32_t a, std::uint32_t b) {
                     return Component(PositionOf(a), axis) < Component(PositionOf(b), axis);
                   });
  const std::uint32_t level = range.level++;
  return {range.first + WholeLeavesMedian(range.count(), max_leaf_size_), level};
}

std::pair<LbvhSplitter::Range, LbvhSplitter::Range> LbvhSplitter::Split(const Range& range) {
  Range whole = range;
  const bool tied = codes_[range.first] == codes_[range.last - 1];
  const Cut cut = tied ? CutTies(whole) : FindCodeCut(whole);
  cut_levels_[cut.place] = static_cast<std::uint8_t>(cut.level);
  return {{{range.first, cut.place, range.depth + 1}, whole.level},
          {{cut.place, range.last, range.depth + 1}, whole.level}};
}

LooseTree BuildLbvh(const std::vector<float>& positions, MortonBits bits, MortonLayout layout,
                    std::uint32_t max_leaf_size, const Cancellation& cancellation) {
  LbvhSplitter splitter(positions, bits, layout, max_leaf_size, cancellation);
  return TopDown(max_leaf_size, splitter, cancellation).Build(splitter.Root());
}

}  // namespace treelight
