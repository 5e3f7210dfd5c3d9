#include "client/bench/judge.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include "fmt/format.h"
#include "tbb/parallel_for.h"

namespace treelight {
namespace {

constexpr double kRounding = 1e-6;  // of a squared distance in float, relative
// Of a squared distance in float whose squares are no normal numbers, absolute.
constexpr double kUnderflow = std::numeric_limits<float>::min();
constexpr double kDensityRounding = 1e-4;  // relative

/// The weight of a photon at squared distance d2, before it is divided by pi R^2.
double Weight(DensityKernel kernel, double d2, double squared_radius) {
  switch (kernel) {
    case DensityKernel::kConstant:
      return 1;
    case DensityKernel::kCone:
      return 3 * (1 - std::sqrt(d2 / squared_radius));
    case DensityKernel::kEpanechnikov:
      return 2 * (1 - d2 / squared_radius);
  }
  return 0;
}

}  // namespace

Judge::Judge(const Photons& photons, std::vector<float> queries, std::uint32_t max_k,
             float max_radius)
    : photons_(photons), queries_(std::move(queries)), truth_(queries_.size() / 3) {
  tbb::parallel_for(std::size_t{0}, truth_.size(), [&](std::size_t i) {
    truth_[i] = FindNearest(&queries_[3 * i], max_k, max_radius);
  });
}

/// All within the radius or the k nearest, whichever are more, nearest first.
std::vector<Judge::Photon> Judge::FindNearest(const float* query, std::uint32_t max_k,
                                              float max_radius) const {
  const auto by_distance = [](const Photon& a, const Photon& b) {
    return a.squared_distance < b.squared_distance;
  };
  const double within =
      std::isinf(max_radius)
          ? 0
          : double{max_radius} * max_radius * (1 + 2 * kRounding) + 2 * kUnderflow;
  double bound = std::numeric_limits<double>::infinity();
  std::vector<Photon> kept;
  std::size_t room = 2 * std::size_t{max_k} + 1;
  const auto count = static_cast<std::uint32_t>(photons_.size());
  for (std::uint32_t id = 0; id < count; ++id) {
    const double d2 = SquaredDistance(query, id);
    if (d2 > bound) continue;
    kept.push_back({d2, id});
    if (kept.size() < room) continue;
    // The k nearest so far, and all that lie within the radius.
    std::nth_element(kept.begin(), kept.begin() + max_k, kept.end(), by_distance);
    bound = std::max(kept[max_k].squared_distance, within);
    std::erase_if(kept, [&](const Photon& photon) { return photon.squared_distance > bound; });
    room = std::max(room, 2 * kept.size());
  }
  std::sort(kept.begin(), kept.end(), by_distance);
  return kept;
}

std::string Judge::WhatIsWrong(const GatherOptions& search, const GatherResult& found,
                               std::span<const std::size_t> places) const {
  assert(places.size() == truth_.size());
  for (std::size_t check = 0; check < places.size(); ++check) {
    const std::size_t place = places[check];
    std::string wrong;
    std::uint32_t count = search.k;
    if ((search.outputs & kOutputCount) != 0) {
      count = found.counts[place];
      wrong = JudgeCount(check, search, count);
    }
    if (wrong.empty() && search.k > 0 && (search.outputs & kOutputNeighbors) != 0) {
      const std::size_t first = place * search.k;
      wrong = JudgeList(check, std::span(found.neighbor_ids).subspan(first, count),
                        std::span(found.neighbor_squared_distances).subspan(first, count));
    }
    if (wrong.empty() && (search.outputs & kOutputDensity) != 0) {
      wrong = JudgeDensity(check, search, std::span(found.densities).subspan(3 * place, 3));
    }
    if (!wrong.empty()) return fmt::format("query {}: {}", place, wrong);
  }
  return {};
}

std::string Judge::JudgeCount(std::size_t check, const GatherOptions& search,
                              std::uint32_t count) const {
  const double squared_radius = double{search.radius} * search.radius;
  const std::uint32_t cap = search.k > 0 ? search.k : std::numeric_limits<std::uint32_t>::max();
  const std::uint32_t least = std::min(cap,
                                       Count(check, squared_radius * (1 - kRounding) - kUnderflow)),
                      most = std::min(cap,
                                      Count(check, squared_radius * (1 + kRounding) + kUnderflow));
  if (count >= least && count <= most) return {};
  return fmt::format("{} photons, expected {} to {}", count, least, most);
}

std::string Judge::JudgeList(std::size_t check, std::span<const std::uint32_t> ids,
                             std::span<const float> squared_distances) const {
  const auto differ = [](double a, double b) {
    return !(std::fabs(a - b) <= kRounding * b + kUnderflow);
  };
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const double expected = truth_[check][i].squared_distance;
    if (differ(squared_distances[i], expected)) {
      return fmt::format("squared distance {} is {}, expected {}", i, squared_distances[i],
                         expected);
    }
    if (ids[i] >= photons_.size() ||
        differ(SquaredDistance(&queries_[3 * check], ids[i]), expected)) {
      return fmt::format("neighbour {} is {}, which is not as near", i, ids[i]);
    }
  }
  std::vector<std::uint32_t> sorted(ids.begin(), ids.end());
  std::sort(sorted.begin(), sorted.end());
  const auto twice = std::adjacent_find(sorted.begin(), sorted.end());
  if (twice != sorted.end()) return fmt::format("neighbour {} is there twice", *twice);
  return {};
}

std::string Judge::JudgeDensity(std::size_t check, const GatherOptions& search,
                                std::span<const float> density) const {
  const std::vector<Photon>& truth = truth_[check];
  double squared_radius = double{search.radius} * search.radius;
  if (search.k > 0 && truth.size() >= search.k) {
    squared_radius = std::min(squared_radius, truth[search.k - 1].squared_distance);
  }
  const std::size_t cap = search.k > 0 ? search.k : truth.size();
  std::array<double, 3> sum{};
  for (std::size_t i = 0; i < std::min(cap, truth.size()); ++i) {
    const auto& [d2, id] = truth[i];
    if (squared_radius == 0 || d2 > squared_radius) break;
    const double weight = Weight(search.kernel, d2, squared_radius);
    for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * photons_.powers[3 * std::size_t{id} + c];
  }
  for (std::size_t c = 0; c < 3; ++c) {
    const double expected = squared_radius == 0 ? 0 : sum[c] / (std::numbers::pi * squared_radius);
    if (std::fabs(density[c] - expected) <= kDensityRounding * std::fabs(expected)) continue;
    return fmt::format("density {} is {}, expected {}", c, density[c], expected);
  }
  return {};
}

std::uint32_t Judge::Count(std::size_t check, double squared_radius) const {
  const auto& truth = truth_[check];
  const auto end = std::upper_bound(
      truth.begin(), truth.end(), squared_radius,
      [](double limit, const Photon& photon) { return limit < photon.squared_distance; });
  return static_cast<std::uint32_t>(end - truth.begin());
}

double Judge::SquaredDistance(const float* query, std::uint32_t id) const {
  const float* const p = &photons_.positions[3 * std::size_t{id}];
  const double dx = double{p[0]} - query[0], dy = double{p[1]} - query[1],
               dz = double{p[2]} - query[2];
  return dx * dx + dy * dy + dz * dz;
}

std::vector<std::size_t> SpreadPlaces(std::size_t query_count, std::size_t count) {
  std::vector<std::size_t> places(count);
  for (std::size_t i = 0; i < count; ++i) places[i] = query_count * i / count;
  return places;
}

std::vector<std::size_t> FindPlaces(std::span<const float> queries, std::span<const float> batch) {
  using Position = std::array<float, 3>;
  const auto at = [](std::span<const float> numbers, std::size_t i) {
    return Position{numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]};
  };
  std::map<Position, std::size_t> wanted;
  for (std::size_t i = 0; i < queries.size() / 3; ++i) wanted[at(queries, i)] = batch.size() / 3;
  for (std::size_t i = 0; i < batch.size() / 3; ++i) {
    const auto found = wanted.find(at(batch, i));
    if (found != wanted.end()) found->second = i;
  }
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < queries.size() / 3; ++i) places.push_back(wanted[at(queries, i)]);
  assert(std::ranges::all_of(places, [&](std::size_t p) { return p < batch.size() / 3; }));
  return places;
}

}  // namespace treelight
