// Errors that are asked for, where a few photons carry most of the light, or a few queries see it
// from the other side: what a sample of the batch does not show. On sets that nothing was tuned
// for: powers and queries are drawn anew.

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "core/builder.h"
#include "core/gatherer.h"
#include "gtest/gtest.h"
#include "tests/merged_maps.h"

namespace treelight {
namespace {

constexpr std::size_t kPhotons = 60'000, kQueries = 2000, kBatches = 12;
constexpr float kError = 0.05f;

Builder& CpuBuilder() {
  static const std::unique_ptr<Builder> builder = MakeCpuBuilder();
  return *builder;
}

/// Photons of power 1 on the unit square.
Photons Square(std::mt19937& random) {
  std::uniform_real_distribution<float> place;
  Photons photons;
  for (std::size_t i = 0; i < kPhotons; ++i) {
    photons.positions.insert(photons.positions.end(), {place(random), place(random), 0});
  }
  photons.powers.assign(3 * kPhotons, 1);
  return photons;
}

void SetPower(Photons& photons, std::size_t i, float power) {
  std::fill_n(photons.powers.begin() + static_cast<std::ptrdiff_t>(3 * i), 3, power);
}

double SumOf(const GatherResult& answer, std::size_t i) {
  return double{answer.densities[3 * i]} + answer.densities[3 * i + 1] +
         answer.densities[3 * i + 2];
}

/// The root mean square of the relative errors.
double ErrorOfAll(const GatherResult& answer, const GatherResult& exact) {
  double squares = 0;
  for (std::size_t i = 0; i < kQueries; ++i) {
    const double is = SumOf(answer, i), should_be = SumOf(exact, i);
    squares += should_be == 0 ? (is == 0 ? 0 : 1) : std::pow(is / should_be - 1, 2);
  }
  return std::sqrt(squares / kQueries);
}

/// How many of kBatches batches, half of the 500 nearest, half within a radius that holds as many,
/// are not within kError; `normals` of one batch, or none.
template <typename Normals>
int MissesOf(const Photons& photons, std::mt19937& random, Normals normals) {
  MergedMaps maps(CpuBuilder(), photons);
  std::uniform_real_distribution<float> place;
  int misses = 0;
  for (std::size_t batch = 0; batch < kBatches; ++batch) {
    std::vector<float> positions;
    for (std::size_t i = 0; i < kQueries; ++i) {
      positions.insert(positions.end(), {place(random), place(random), 0});
    }
    const std::vector<float> facing = normals();
    const GatherQueries queries{.positions = positions, .normals = facing};
    GatherOptions options{.outputs = kOutputDensity,
                          .approximation = {.max_relative_error = kError}};
    if (batch % 2 == 0) {
      options.k = 500;
    } else {
      options.radius = std::sqrt(500 / (3.14159f * kPhotons));
    }
    const MergeChoice choice = maps.Choose(queries, options);
    if (choice.exact()) continue;
    const auto exact = *maps.map().Gather(queries, ExactOptions(options));
    const auto answer = *GatherMerged(maps.map(), choice.merged, queries, options);
    if (ErrorOfAll(answer, exact) > kError) ++misses;
  }
  return misses;
}

std::vector<float> NoNormals() { return {}; }

TEST(UnequalPowersTest, MeanPowerIsThatOfThePhotonsWithTheLight) {
  Photons photons;
  photons.powers = {1, 1, 1, -1, 1, 1, 0, 0, 0, 1, 2, 0};
  EXPECT_DOUBLE_EQ(MeanPower(photons), 3);
  photons.powers[0] = 1e9f;
  EXPECT_NEAR(MeanPower(photons), 1e9, 10);
  photons.powers.assign(12, 0);
  EXPECT_EQ(MeanPower(photons), 0);
}

TEST(UnequalPowersTest, AFewPhotonsThatOutshineAll) {
  const std::uint32_t seed = std::random_device{}();
  for (const auto& [bright, power] : {std::pair{10, 1e6f}, {1, 1e9f}, {3, 1e4f}}) {
    std::mt19937 random(seed);
    Photons photons = Square(random);
    for (int i = 0; i < bright; ++i) SetPower(photons, static_cast<std::size_t>(i), power);
    EXPECT_EQ(MissesOf(photons, random, NoNormals), 0) << bright << " of " << power << ", " << seed;
  }
}

TEST(UnequalPowersTest, SumsThatNoFloatHoldsAreTheLargest) {
  std::mt19937 random(1);
  Photons photons = Square(random);
  photons.powers.assign(photons.powers.size(), -3e38f);
  MergedMaps maps(CpuBuilder(), photons);
  for (const auto kind : {FewerPhotons::Kind::kMerged, FewerPhotons::Kind::kThinned}) {
    const Photons fewer = *maps.Fewer({kind, 8}).map->ReadPhotons();
    EXPECT_LT(fewer.size(), photons.size() / 4);
    EXPECT_EQ(*std::ranges::max_element(fewer.powers), -std::numeric_limits<float>::max());
  }
}

TEST(UnequalPowersTest, PowersOfManyMagnitudes) {
  const std::uint32_t seed = std::random_device{}();
  for (const float sigma : {1.0f, 3.0f, 4.0f}) {
    std::mt19937 random(seed);
    Photons photons = Square(random);
    std::normal_distribution<float> exponent(0, sigma);
    for (std::size_t i = 0; i < kPhotons; ++i) SetPower(photons, i, std::exp(exponent(random)));
    EXPECT_EQ(MissesOf(photons, random, NoNormals), 0) << "sigma " << sigma << ", " << seed;
  }
}

TEST(UnequalPowersTest, AFewQueriesThatSeeLittleOfTheLight) {
  const std::uint32_t seed = std::random_device{}();
  for (const double part : {0.03, 0.003}) {
    std::mt19937 random(seed);
    Photons photons = Square(random);
    std::bernoulli_distribution comes_from_below(part), faces_down(0.01);
    std::uniform_int_distribution<int> slope(-10'000, 10'000);
    for (std::size_t i = 0; i < kPhotons; ++i) {
      // Octahedral: the inner diamond travels up, the corners down.
      const int u = slope(random), v = slope(random);
      const bool up = comes_from_below(random);
      photons.directions.push_back(static_cast<std::int16_t>(up      ? u
                                                             : u > 0 ? 32767 - u
                                                                     : -32767 - u));
      photons.directions.push_back(static_cast<std::int16_t>(up      ? v
                                                             : v > 0 ? 32767 - v
                                                                     : -32767 - v));
    }
    const int misses = MissesOf(photons, random, [&] {
      std::vector<float> normals;
      for (std::size_t i = 0; i < kQueries; ++i) {
        normals.insert(normals.end(), {0, 0, faces_down(random) ? -1.0f : 1.0f});
      }
      return normals;
    });
    EXPECT_LE(misses, 1) << part << " from below, " << seed;
  }
}

}  // namespace
}  // namespace treelight
