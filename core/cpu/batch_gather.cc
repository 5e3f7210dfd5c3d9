#include "core/cpu/batch_gather.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "core/cpu/density.h"
#include "core/cpu/radix_sort.h"
#include "core/cpu/whole_sum.h"
#include "core/model/morton.h"
#include "tbb/parallel_for.h"

namespace treelight {
namespace {

// From this many queries on, sorting them pays.
constexpr std::size_t kSortedQueries = 256;
// Queries of one task: of cheap ones more, since the first of each knows no bound of one before it.
constexpr std::size_t kCheapTaskQueries = 64, kTaskQueries = 8;
constexpr std::uint32_t kMaxCheapK = 128;
constexpr unsigned kOrderBits = 30;

Vec3 At(std::span<const float> numbers, std::size_t i) {
  return {numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]};
}

/// Queries in Morton order: those that follow each other visit the same nodes.
std::vector<std::uint32_t> MakeOrder(const GatherQueries& queries, const Box& bounds) {
  std::vector<std::uint32_t> order(queries.size());
  std::iota(order.begin(), order.end(), 0u);
  if (queries.size() < kSortedQueries) return order;
  struct Coded {
    std::uint32_t code, query;
  };
  const MortonGrid grid = MakeMortonGrid(bounds, kOrderBits / 3);
  std::vector<Coded> coded(queries.size()), spare;
  tbb::parallel_for(std::size_t{0}, queries.size(), [&](std::size_t i) {
    const auto code = MortonCode(At(queries.positions, i), grid, kOrderBits / 3);
    coded[i] = {static_cast<std::uint32_t>(code), static_cast<std::uint32_t>(i)};
  });
  RadixSort(coded, spare, kOrderBits, [](const Coded& item) { return item.code; });
  std::transform(coded.begin(), coded.end(), order.begin(),
                 [](const Coded& item) { return item.query; });
  return order;
}

/// The largest squared distance that the k-th neighbour of a query can have, seen from an earlier
/// query that found k neighbours: they are all within its own k-th distance and the way between the
/// two.
class NeighborBound {
 public:
  float operator()(const Vec3& center) const {
    const double dx = double{center.x} - center_.x, dy = double{center.y} - center_.y,
                 dz = double{center.z} - center_.z;
    const double reach = distance_ + std::sqrt(dx * dx + dy * dy + dz * dz);
    // Far above the roundings of a squared distance, but for those that underflow.
    const double bound = reach * reach * (1 + 1e-5);
    constexpr double kSmallest = 1e-30, kLargest = std::numeric_limits<float>::max();
    return bound > kSmallest && bound < kLargest ? static_cast<float>(bound)
                                                 : std::numeric_limits<float>::max();
  }

  void Set(const Vec3& center, float squared_distance) {
    center_ = center;
    distance_ = std::sqrt(double{squared_distance});
  }

 private:
  Vec3 center_;
  double distance_ = std::numeric_limits<double>::infinity();
};

class Batch {
 public:
  Batch(const SearchedMap& map, const GatherQueries& queries, const GatherOptions& options,
        const CancelCheck& cancelled)
      : search_(map.search),
        photons_(map.photons),
        moments_(map.moments),
        queries_(queries),
        options_(options),
        cancelled_(cancelled),
        stop_(cancelled && cancelled()) {}

  absl::StatusOr<GatherResult> Run(const Box& bounds) {
    const std::size_t m = queries_.size();
    const bool lists = Wants(kOutputNeighbors);
    if (Wants(kOutputCount) || (lists && options_.k == 0)) result_.counts.resize(m);
    if (Wants(kOutputRadius)) result_.radii.resize(m);
    if (Wants(kOutputDensity)) result_.densities.resize(3 * m);
    if (options_.approximation.any()) result_.error_bounds.resize(m);
    order_ = MakeOrder(queries_, bounds);
    if (options_.k > 0) {
      if (lists) {
        result_.neighbor_ids.resize(m * options_.k);
        result_.neighbor_squared_distances.resize(m * options_.k);
      }
      ForEachTask([&](auto first, auto last) { GatherNearest(first, last); });
    } else {
      ForEachTask([&](auto first, auto last) { GatherWithin(first, last); });
      if (lists && !stop_) {
        if (auto status = PlaceLists(); !status.ok()) return status;
        ForEachTask([&](auto first, auto last) { ListWithin(first, last); });
      }
    }
    if (stop_) return absl::CancelledError("gather cancelled");
    if (!Wants(kOutputCount)) result_.counts.clear();
    return std::move(result_);
  }

 private:
  bool Wants(std::uint32_t output) const { return (options_.outputs & output) != 0; }
  bool WantsDensity() const { return Wants(kOutputDensity) && !photons_.powers.empty(); }

  float Radius(std::uint32_t query) const {
    return queries_.radii.empty() ? options_.radius : queries_.radii[query];
  }

  /// r*r, finite.
  float SquaredRadius(std::uint32_t query) const {
    const float radius = Radius(query);
    return std::min(radius * radius, std::numeric_limits<float>::max());
  }

  /// Calls `work(first, last)` with pieces of the order.
  template <typename Work>
  void ForEachTask(const Work& work) {
    const bool is_cheap = options_.k > 0 && options_.k <= kMaxCheapK;
    const std::size_t piece = is_cheap ? kCheapTaskQueries : kTaskQueries;
    const std::size_t tasks = (order_.size() + piece - 1) / piece;
    tbb::parallel_for(std::size_t{0}, tasks, [&](std::size_t task) {
      if (stop_ || (cancelled_ && cancelled_())) {
        stop_ = true;
        return;
      }
      const std::uint32_t* const first = order_.data() + task * piece;
      work(first, first + std::min(piece, order_.size() - task * piece));
    });
  }

  void GatherNearest(const std::uint32_t* first, const std::uint32_t* last) {
    const Approximation& approximation = options_.approximation;
    SearchSpace space;
    NeighborBound bound;
    for (; first < last; ++first) {
      const std::uint32_t query = *first;
      const Vec3 center = At(queries_.positions, query);
      const float limit = std::min(SquaredRadius(query), bound(center));
      const FoundNearest found =
          approximation.any()
              ? search_.FindAboutNearest(center, options_.k, limit, approximation, space)
              : search_.FindNearest(center, options_.k, limit, space);
      float radius = Radius(query);
      if (found.count == options_.k) {
        bound.Set(center, found.farthest);
        radius = std::sqrt(found.farthest);
      }
      if (approximation.any()) {
        result_.error_bounds[query] =
            NearestErrorBound(found.count == options_.k, found.farthest, found.given_up);
      }
      if (Wants(kOutputNeighbors)) WriteNearest(query, found.count, space);
      Write(query, found.count, radius);
      if (!WantsDensity()) continue;
      DensitySum sum = StartDensity(query, radius);
      AddDensity(found.count, space, sum);
      WriteDensity(query, sum);
    }
  }

  void WriteNearest(std::uint32_t query, std::uint32_t count, SearchSpace& space) {
    search_.Sort(count, space);
    const std::size_t place = std::size_t{query} * options_.k;
    std::uint32_t* const ids = &result_.neighbor_ids[place];
    float* const distances = &result_.neighbor_squared_distances[place];
    std::fill(std::copy_n(space.ids(), count, ids), ids + options_.k, kNoPhoton);
    std::fill(std::copy_n(space.squared_distances(), count, distances), distances + options_.k,
              std::numeric_limits<float>::infinity());
  }

  /// What lists do not hold.
  void Write(std::uint32_t query, std::uint32_t count, float radius) {
    if (!result_.counts.empty()) result_.counts[query] = count;
    if (Wants(kOutputRadius)) result_.radii[query] = radius;
  }

  DensitySum StartDensity(std::uint32_t query, float radius) const {
    const float* const normal =
        queries_.normals.empty() ? nullptr : &queries_.normals[3 * std::size_t{query}];
    return {photons_, normal, options_.kernel, radius};
  }

  static void AddDensity(std::uint32_t count, SearchSpace& space, DensitySum& sum) {
    for (std::uint32_t i = 0; i < count; ++i) {
      sum.Add(space.squared_distances()[i], space.ids()[i]);
    }
  }

  void WriteDensity(std::uint32_t query, const DensitySum& sum) {
    sum.Write(&result_.densities[3 * std::size_t{query}]);
  }

  void GatherWithin(const std::uint32_t* first, const std::uint32_t* last) {
    SearchSpace space;
    for (; first < last; ++first) {
      const std::uint32_t query = *first;
      const Vec3 center = At(queries_.positions, query);
      const float limit = SquaredRadius(query), radius = Radius(query);
      std::uint32_t count = 0;
      if (WantsDensity()) {
        DensitySum sum = StartDensity(query, radius);
        const auto take = [&](std::uint32_t found) {
          AddDensity(found, space, sum);
          count += found;
        };
        if (moments_.empty() || limit == 0) {
          take(search_.FindWithin(center, limit, space, take));
        } else {
          double error = 0;
          const auto take_whole = [&](const WholeSubtree& whole) {
            const bool taken = AddWhole(whole, center, radius, sum, error);
            if (taken) count += whole.count;
            return taken;
          };
          take(search_.FindWithinBeside(center, limit, take_whole, space, take));
          result_.error_bounds[query] = sum.PerArea(error);
        }
        WriteDensity(query, sum);
      } else if (!result_.counts.empty()) {
        count = search_.CountWithin(center, limit);
      }
      Write(query, count, radius);
    }
  }

  /// Adds up a subtree by its moments, where that may be.
  bool AddWhole(const WholeSubtree& whole, const Vec3& center, float radius, DensitySum& sum,
                double& error) const {
    const float squared_radius = radius * radius;
    const auto weight =
        Linearise(options_.kernel, whole.near / squared_radius, whole.far / squared_radius);
    const float allowed = options_.approximation.weight_tolerance * PeakWeight(options_.kernel);
    if (weight.error > allowed) return false;
    const auto added = SumOf(moments_[whole.slot], whole.box, center, radius, weight);
    sum.AddWhole({added.sums[0], added.sums[1], added.sums[2]});
    error += added.error;
    return true;
  }

  absl::Status PlaceLists() {
    std::vector<std::uint64_t>& offsets = result_.neighbor_offsets;
    offsets.assign(queries_.size() + 1, 0);
    std::inclusive_scan(result_.counts.begin(), result_.counts.end(), offsets.begin() + 1,
                        std::plus<>(), std::uint64_t{0});
    if (auto status = CheckNeighborCount(offsets.back(), options_); !status.ok()) return status;
    result_.neighbor_ids.resize(offsets.back());
    result_.neighbor_squared_distances.resize(offsets.back());
    return absl::OkStatus();
  }

  void ListWithin(const std::uint32_t* first, const std::uint32_t* last) {
    SearchSpace space;
    for (; first < last; ++first) {
      const std::uint32_t query = *first;
      const std::uint32_t count =
          search_.FindWithin(At(queries_.positions, query), SquaredRadius(query), space);
      search_.Sort(count, space);
      const std::uint64_t place = result_.neighbor_offsets[query];
      std::copy_n(space.ids(), count, result_.neighbor_ids.begin() + place);
      std::copy_n(space.squared_distances(), count,
                  result_.neighbor_squared_distances.begin() + place);
    }
  }

  const PackedSearch& search_;
  const Photons& photons_;
  const std::span<const PowerMoments> moments_;
  const GatherQueries& queries_;
  const GatherOptions& options_;
  const CancelCheck& cancelled_;
  std::atomic<bool> stop_;
  std::vector<std::uint32_t> order_;
  GatherResult result_;
};

}  // namespace

absl::StatusOr<GatherResult> GatherBatch(const SearchedMap& map, const GatherQueries& queries,
                                         const GatherOptions& options,
                                         const CancelCheck& cancelled) {
  return Batch(map, queries, options, cancelled).Run(map.bounds);
}

}  // namespace treelight
