#include "tests/stability/hard_case.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>
#include <numeric>
#include <span>

#include "fmt/format.h"
#include "tests/answers.h"
#include "tests/tree_kinds.h"

namespace treelight {
namespace {

constexpr std::uint32_t kExact = kOutputCount | kOutputRadius | kOutputNeighbors;
constexpr double kDensityRounding = 1e-6;
// Lists of all within a radius may hold every photon.
constexpr std::size_t kListedQueries = 8;

/// The largest weight of a kernel times the largest power of MakeCloud.
constexpr double kLargestWeight = 3 * 1.5;

/// Whether the densities of query i are the same but for the roundings of its addends. A photon at
/// the very radius weighs nothing, so the sum may be far less than they are.
bool SameDensity(const GatherResult& actual, const GatherResult& expected, std::size_t i) {
  const double area = std::numbers::pi * expected.radii[i] * expected.radii[i];
  const double addends = expected.counts[i] * kLargestWeight / area;
  for (std::size_t c = 3 * i; c < 3 * i + 3; ++c) {
    const double a = actual.densities[c], e = expected.densities[c];
    if (std::isinf(e) ? a != e : !(std::fabs(a - e) <= kDensityRounding * addends)) {
      return a == 0 && e == 0;
    }
  }
  return true;
}

}  // namespace

const std::vector<StabilityTree>& StabilityTrees() {
  static const std::vector<StabilityTree> trees = [] {
    std::vector<StabilityTree> all;
    for (const char* name : {"lbvh", "treelet_isa", "hybrid", "trbvh_sah", "atrbvh", "balanced",
                             "sah", "vvh", "isa", "karras"}) {
      const auto kinds = AllTreeKinds();
      const auto kind = std::find_if(kinds.begin(), kinds.end(),
                                     [name](const auto& known) { return known.name == name; });
      const std::string plain = BuilderName(kind->options);
      if (!ReadsMortonBits(kind->options.builder)) {
        all.push_back({plain, kind->options});
        continue;
      }
      for (const MortonBits bits : {MortonBits::k30, MortonBits::k63}) {
        all.push_back({fmt::format("{}_{}", plain, static_cast<unsigned>(bits)), kind->options});
        all.back().options.morton_bits = bits;
      }
    }
    return all;
  }();
  return trees;
}

HardCase::HardCase(const CloudShape& shape, std::size_t photon_count, std::size_t query_count,
                   std::uint32_t seed)
    : name_(shape.name),
      photons_(MakeCloud(shape, photon_count, seed)),
      queries_(MakeQueries(photons_, query_count, seed + 1)) {
  const auto brute = *MakeBruteForceBuilder()->Build(photons_, {});
  const float radius = MedianRadius(*brute, {.positions = queries_}, 20);
  for (const std::uint32_t k : {1u, 8u, 50u}) {
    searches_.push_back({fmt::format("k {}", k), {.k = k, .outputs = kExact}});
    searches_.push_back({fmt::format("k {} within {:g}", k, radius),
                         {.k = k, .radius = radius, .outputs = kExact | kOutputDensity}});
    searches_.push_back(
        {fmt::format("k {} within 0", k), {.k = k, .radius = 0, .outputs = kExact}});
  }
  if (photon_count + 7 <= kMaxNeighbors) {
    const auto more = static_cast<std::uint32_t>(photon_count + 7);
    searches_.push_back({"k > N", {.k = more, .outputs = kExact}});
    searches_.push_back({fmt::format("k > N within {:g}", radius),
                         {.k = more, .radius = radius, .outputs = kExact}});
  }
  // The squares of the second and the third underflow, that of the last overflows.
  for (const float r : {0.0f, 1e-22f, 1e-30f, radius, 2 * radius, 1e20f}) {
    searches_.push_back({fmt::format("list within {:g}", r), {.radius = r, .outputs = kExact}});
    searches_.push_back({fmt::format("count within {:g}", r), {.radius = r}});
    searches_.push_back({fmt::format("density within {:g}", r),
                         {.radius = r, .outputs = kOutputCount | kOutputRadius | kOutputDensity}});
  }
  for (const HardSearch& search : searches_) {
    answers_.push_back(*brute->Gather(QueriesOf(search), search.options));
  }
}

GatherQueries HardCase::QueriesOf(const HardSearch& search) const {
  const bool all_listed = search.options.k == 0 && (search.options.outputs & kOutputNeighbors) != 0;
  const std::size_t numbers =
      all_listed ? std::min(queries_.size(), 3 * kListedQueries) : queries_.size();
  return {.positions = std::span(queries_).first(numbers)};
}

testing::AssertionResult HardCase::AnswersAsBruteForce(const Gatherer& map) const {
  for (std::size_t s = 0; s < searches_.size(); ++s) {
    const auto answer = map.Gather(QueriesOf(searches_[s]), searches_[s].options);
    if (!answer.ok()) {
      return testing::AssertionFailure() << searches_[s].name << ": " << answer.status();
    }
    if (const auto same = SameExactAnswers(*answer, answers_[s]); !same) {
      return testing::AssertionFailure() << searches_[s].name << ": " << same.message();
    }
    if (answers_[s].densities.empty()) continue;
    for (std::size_t i = 0; i < answers_[s].counts.size(); ++i) {
      if (SameDensity(*answer, answers_[s], i)) continue;
      return testing::AssertionFailure()
             << searches_[s].name << ": the density of query " << i << " is "
             << answer->densities[3 * i] << ", expected " << answers_[s].densities[3 * i] << " of "
             << answers_[s].counts[i] << " photons within " << answers_[s].radii[i];
    }
  }
  return testing::AssertionSuccess();
}

std::size_t HardCase::TiesAtRankK() const {
  constexpr std::uint32_t k = 8;
  const auto brute = *MakeBruteForceBuilder()->Build(photons_, {});
  const auto answer =
      brute->Gather({.positions = queries_}, {.k = k + 1, .outputs = kOutputNeighbors});
  std::size_t ties = 0;
  for (std::size_t i = k; i < answer->neighbor_ids.size(); i += k + 1) {
    ties += answer->neighbor_ids[i] != kNoPhoton &&
            answer->neighbor_squared_distances[i] == answer->neighbor_squared_distances[i - 1];
  }
  return ties;
}

double WorkOfSearches(const Gatherer& map, const Photons& photons) {
  constexpr std::size_t kSearches = 256;
  std::vector<float> queries;
  for (std::size_t i = 0; i < kSearches; ++i) {
    const float* const p = &photons.positions[3 * (photons.size() * i / kSearches)];
    queries.insert(queries.end(), p, p + 3);
  }
  const auto answer = map.Gather({.positions = queries}, {.k = 50, .outputs = kOutputStatistics});
  const auto sum = [](const std::vector<std::uint32_t>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0);
  };
  return (sum(answer->nodes_visited) + sum(answer->distance_tests)) / kSearches;
}

bool SameBits(const GatherResult& a, const GatherResult& b) {
  const bool same_densities =
      a.densities.size() == b.densities.size() &&
      (a.densities.empty() || std::memcmp(a.densities.data(), b.densities.data(),
                                          a.densities.size() * sizeof(float)) == 0);
  return same_densities && SameExactAnswers(a, b);
}

}  // namespace treelight
