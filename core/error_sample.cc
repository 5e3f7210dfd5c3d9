#include "core/error_sample.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/model/split_mix.h"

namespace treelight {
namespace {

// One query in so many is sampled, and at least so many where an error has to be kept.
constexpr std::size_t kSampledPart = 32, kFewestSamples = 128, kMostSamples = 4096;

// Standard errors of the mean square between what is measured and what is taken for granted.
constexpr double kMargin = 3;

// What is as rare as one query in a third of the sample is missing from it in one case of 20 (the
// rule of three): so many queries are taken to be there, with the largest error seen, at least
// this. Where normals leave photons out, few may be left of many, and rare errors are large.
constexpr double kMissedQueries = 3, kMissedError = 0.1, kMissedErrorOfNormals = 0.3;

double MissedError(const GatherQueries& queries) {
  return queries.normals.empty() ? kMissedError : kMissedErrorOfNormals;
}

double SumOfChannels(const GatherResult& answer, std::size_t query) {
  const float* const density = &answer.densities[3 * query];
  return double{density[0]} + density[1] + density[2];
}

double SquaredError(double density, double exact) {
  if (density == exact) return 0;
  if (exact == 0) return 1;
  const double error = density / exact - 1;
  return std::isnan(error) ? std::numeric_limits<double>::infinity() : error * error;
}

}  // namespace

std::size_t SampleSize(const GatherQueries& queries, double error) {
  const std::size_t part = (queries.size() + kSampledPart - 1) / kSampledPart;
  const std::size_t count = std::min(part, kMostSamples);
  if (error == 0) return count;
  const double missed = MissedError(queries) / error;
  const double needed = std::max(2 * kMissedQueries * missed * missed, double{kFewestSamples});
  const auto all = static_cast<double>(queries.size());
  return std::max(count, static_cast<std::size_t>(std::min(std::ceil(needed), all)));
}

std::vector<std::uint32_t> SampledQueries(std::size_t query_count, std::size_t count) {
  std::vector<std::uint32_t> chosen(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t first = i * query_count / count, last = (i + 1) * query_count / count;
    chosen[i] = static_cast<std::uint32_t>(first + SplitMix(query_count + i) % (last - first));
  }
  return chosen;
}

SampledError ErrorOf(const GatherResult& answer, const GatherResult& exact,
                     const GatherQueries& queries) {
  double sum = 0, sum_of_squares = 0, largest = 0;
  for (std::size_t i = 0; i < queries.size(); ++i) {
    const double square = SquaredError(SumOfChannels(answer, i), SumOfChannels(exact, i));
    sum += square;
    sum_of_squares += square * square;
    largest = std::max(largest, square);
  }
  const auto n = static_cast<double>(queries.size());
  const double mean = sum / n;
  const double variance = std::max(0.0, sum_of_squares / n - mean * mean) / std::max(1.0, n - 1);
  const double missed_error = MissedError(queries);
  const double missed = kMissedQueries * std::max(largest, missed_error * missed_error) / n;
  return {std::sqrt(mean), std::sqrt(mean + kMargin * std::sqrt(variance) + missed)};
}

}  // namespace treelight
