#include "client/accuracy/truth.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/model/octahedral.h"
#include "tbb/parallel_for.h"

namespace treelight::client {
namespace {

struct Photon {
  double squared_distance;
  std::uint32_t id;
};

double Square(double x) { return x * x; }

double SquaredDistance(const Photons& photons, std::size_t photon, const float* query) {
  const float* const p = &photons.positions[3 * photon];
  return Square(double{p[0]} - query[0]) + Square(double{p[1]} - query[1]) +
         Square(double{p[2]} - query[2]);
}

std::vector<Photon> MeasureAll(const Photons& photons, const float* query) {
  std::vector<Photon> all(photons.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    all[i] = {SquaredDistance(photons, i, query), static_cast<std::uint32_t>(i)};
  }
  return all;
}

/// Whether it comes against `normal`, which may be null, as every part of Treelight decides it.
bool Faces(const Photons& photons, std::uint32_t photon, const float* normal) {
  return normal == nullptr || ComesAgainst(&photons.directions[2 * std::size_t{photon}], normal);
}

TrueAnswer Answer(const Photons& photons, const float* query, const float* normal, std::uint32_t k,
                  float radius) {
  std::vector<Photon> near = MeasureAll(photons, query);
  double squared_radius = Square(radius);
  if (k > 0 && k <= near.size()) {
    const auto kth = near.begin() + (k - 1);
    std::nth_element(near.begin(), kth, near.end(), [](const Photon& a, const Photon& b) {
      return a.squared_distance < b.squared_distance;
    });
    if (kth->squared_distance <= squared_radius) squared_radius = kth->squared_distance;
    near.resize(k);
  }
  double sum = 0;
  for (const Photon& photon : near) {
    if (photon.squared_distance > squared_radius || !Faces(photons, photon.id, normal)) continue;
    const float* const power = &photons.powers[3 * std::size_t{photon.id}];
    sum += 2 * (1 - photon.squared_distance / squared_radius) *
           (double{power[0]} + power[1] + power[2]);
  }
  const bool is_empty = !(squared_radius > 0) || std::isinf(squared_radius);
  return {.distance = std::sqrt(squared_radius),
          .density = is_empty ? 0 : sum / (std::numbers::pi * squared_radius)};
}

double SumOfChannels(const GatherResult& answer, std::size_t query) {
  const float* const density = &answer.densities[3 * query];
  return double{density[0]} + density[1] + density[2];
}

}  // namespace

std::vector<TrueAnswer> ComputeTruth(const Photons& photons, const GatherQueries& queries,
                                     std::uint32_t k, float radius) {
  std::vector<TrueAnswer> truth(queries.size());
  tbb::parallel_for(std::size_t{0}, truth.size(), [&](std::size_t i) {
    const float* const normal = queries.normals.empty() ? nullptr : &queries.normals[3 * i];
    truth[i] = Answer(photons, &queries.positions[3 * i], normal, k, radius);
  });
  return truth;
}

double DensityError(const GatherResult& answer, const GatherResult& exact) {
  double squares = 0;
  const std::size_t count = exact.densities.size() / 3;
  for (std::size_t i = 0; i < count; ++i) {
    const double is = SumOfChannels(answer, i), should_be = SumOfChannels(exact, i);
    if (is != should_be) squares += should_be == 0 ? 1 : Square(is / should_be - 1);
  }
  return std::sqrt(squares / std::max<double>(1, static_cast<double>(count)));
}

AnswerError CompareAnswers(const Photons& photons, std::span<const float> queries,
                           const GatherResult& answer, std::span<const TrueAnswer> truth,
                           std::uint32_t k) {
  AnswerError error;
  double distances = 0, densities = 0, found = 0;
  std::size_t density_count = 0, bound_count = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (k > 0) {
      distances += Square(answer.radii[i] / truth[i].distance - 1);
      if (answer.neighbor_ids.empty()) continue;  // of fewer photons
      // Within float's rounding of the k-th.
      const double limit = Square(truth[i].distance) * (1 + 1e-6);
      for (std::uint32_t j = 0; j < k; ++j) {
        const std::uint32_t id = answer.neighbor_ids[std::size_t{i} * k + j];
        const bool is_right =
            id != kNoPhoton && SquaredDistance(photons, id, &queries[3 * i]) <= limit;
        found += is_right ? 1 : 0;
      }
    }
  }
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (truth[i].density == 0) continue;
    if (!answer.error_bounds.empty() && std::isfinite(answer.error_bounds[i])) {
      // That of a density is of each channel, in its unit.
      const double unit = k > 0 ? 1 : truth[i].density / 3;
      error.bound += answer.error_bounds[i] / unit;
      ++bound_count;
    }
    densities += Square(SumOfChannels(answer, i) / truth[i].density - 1);
    ++density_count;
  }
  if (bound_count > 0) error.bound /= static_cast<double>(bound_count);
  const auto m = static_cast<double>(truth.size());
  if (k > 0) {
    error.distance = std::sqrt(distances / m);
    error.recall = found / (m * k);
  }
  error.density = std::sqrt(densities / std::max<double>(1, static_cast<double>(density_count)));
  return error;
}

}  // namespace treelight::client
