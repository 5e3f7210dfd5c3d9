// The directions of merged photons: that of a group is the best of its photons by plain sums, and
// before a normal there is about as much light as with the directions of all photons.

#include "core/model/facing_balance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <vector>

#include "core/builder.h"
#include "core/merged_gather.h"
#include "core/model/merge_photons.h"
#include "core/model/octahedral.h"
#include "gtest/gtest.h"
#include "tests/clouds.h"

namespace treelight {
namespace {

using Random = std::mt19937;

Vec3 RandomUnit(Random& random) {
  std::normal_distribution<float> normal;
  const Vec3 v = {normal(random), normal(random), normal(random)};
  const float length = std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z);
  return {v.x / length, v.y / length, v.z / length};
}

bool Faces(const std::array<std::int16_t, 2>& direction, const Vec3& normal) {
  const Vec3 d = DecodeOctahedral(direction[0], direction[1]);
  return d.x * normal.x + d.y * normal.y + d.z * normal.z < 0;
}

/// Photons that may become one, with their directions.
struct Group {
  std::vector<GroupMember> members;
  std::vector<std::array<std::int16_t, 2>> directions;

  double weight() const {
    double sum = 0;
    for (const GroupMember& member : members) sum += member.weight;
    return sum;
  }
  /// The weight before `normal`, and what it is where all have the direction of `chosen`.
  double Before(const Vec3& normal) const {
    double sum = 0;
    for (std::size_t i = 0; i < members.size(); ++i) {
      sum += Faces(directions[i], normal) ? members[i].weight : 0;
    }
    return sum;
  }
  double BeforeAs(std::size_t chosen, const Vec3& normal) const {
    return Faces(directions[chosen], normal) ? weight() : 0;
  }
};

Group MakeGroup(const FacingBalance& balance, std::size_t size, double scale, Random& random) {
  std::uniform_real_distribution<double> weight(0.5, 1.5);
  Group group;
  for (std::uint32_t i = 0; i < size; ++i) {
    group.directions.push_back(EncodeOctahedral(RandomUnit(random)));
    group.members.push_back({.id = i,
                             .weight = scale * weight(random),
                             .faces = balance.FacesOf(group.directions.back().data())});
  }
  return group;
}

TEST(FacingBalanceTest, NormalsAreSpreadOverAHemisphere) {
  const FacingBalance balance;
  double nearest = 1;  // cosine to the nearest normal or its opposite
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const Vec3 v = RandomUnit(random);
    float cosine = 0;
    for (const Vec3& n : balance.normals()) {
      ASSERT_GT(n.z, 0);
      ASSERT_NEAR(n.x * n.x + n.y * n.y + n.z * n.z, 1, 1e-6);
      cosine = std::max(cosine, std::fabs(v.x * n.x + v.y * n.y + v.z * n.z));
    }
    nearest = std::min<double>(nearest, cosine);
  }
  EXPECT_GT(nearest, std::cos(0.35));  // 32 caps of half a sphere have radii of 0.25
}

TEST(FacingBalanceTest, FacesAreTheNormalsThatADirectionGoesAgainst) {
  const FacingBalance balance;
  Random random(2);
  for (int i = 0; i < 1000; ++i) {
    const auto direction = EncodeOctahedral(RandomUnit(random));
    const std::uint32_t faces = balance.FacesOf(direction.data());
    for (std::size_t n = 0; n < FacingBalance::kNormals; ++n) {
      ASSERT_EQ((faces >> n & 1) != 0, Faces(direction, balance.normals()[n]));
    }
  }
}

TEST(FacingBalanceTest, TheChosenPhotonLeavesTheLeastErrorOfAll) {
  FacingBalance balance;
  Random random(3);
  std::array<double, FacingBalance::kNormals> errors{};
  for (int i = 0; i < 500; ++i) {
    const Group group = MakeGroup(balance, 1 + random() % 16, i % 100 == 0 ? 1000 : 1, random);
    const auto after = [&](std::size_t chosen) {
      auto left = errors;
      for (std::size_t n = 0; n < left.size(); ++n) {
        const Vec3& normal = balance.normals()[n];
        left[n] =
            left[n] * FacingBalance::kKept + group.Before(normal) - group.BeforeAs(chosen, normal);
      }
      return left;
    };
    const auto sum_of_squares = [&](std::size_t chosen) {
      double sum = 0;
      for (const double error : after(chosen)) sum += error * error;
      return sum;
    };
    const std::uint32_t chosen = balance.Choose(group.members);
    ASSERT_LT(chosen, group.members.size());
    double least = sum_of_squares(0);
    for (std::size_t c = 1; c < group.members.size(); ++c) {
      least = std::min(least, sum_of_squares(c));
    }
    ASSERT_LE(sum_of_squares(chosen), least * (1 + 1e-9) + 1e-9) << i;
    errors = after(chosen);
  }
}

TEST(FacingBalanceTest, OfEqualPhotonsTheSmallestIdIsChosen) {
  FacingBalance balance;
  EXPECT_EQ(balance.Choose(std::vector<GroupMember>{{.id = 7}}), 7u);  // no weight
  EXPECT_EQ(balance.Choose(std::vector<GroupMember>{{.id = 9, .weight = 1, .faces = 5},
                                                    {.id = 3, .weight = 1, .faces = 5}}),
            3u);
}

/// RMS over windows of 64 groups and random normals of what is before a normal too much, relative
/// to the weight of the window.
double WindowError(const std::vector<Group>& groups, const std::vector<std::size_t>& chosen) {
  Random random(5);
  double squares = 0;
  int count = 0;
  for (std::size_t first = 0; first + 64 <= groups.size(); first += 64) {
    for (int i = 0; i < 16; ++i) {
      const Vec3 normal = RandomUnit(random);
      double error = 0, weight = 0;
      for (std::size_t g = first; g < first + 64; ++g) {
        error += groups[g].BeforeAs(chosen[g], normal) - groups[g].Before(normal);
        weight += groups[g].weight();
      }
      squares += error * error / (weight * weight);
      ++count;
    }
  }
  return std::sqrt(squares / count);
}

TEST(FacingBalanceTest, NeighbouringGroupsTogetherAreRightBeforeAnyNormal) {
  // A bright group first, which what follows must not make up for.
  FacingBalance balance;
  Random random(4);
  std::vector<Group> groups;
  std::vector<std::size_t> chosen, drawn;
  balance.Choose(MakeGroup(balance, 8, 1e6, random).members);
  for (int i = 0; i < 256; ++i) balance.Choose(MakeGroup(balance, 8, 1, random).members);
  for (int i = 0; i < 64 * 100; ++i) {
    groups.push_back(MakeGroup(balance, 8, 1, random));
    chosen.push_back(balance.Choose(groups.back().members));
    drawn.push_back(random() % 8);
  }
  const double error = WindowError(groups, chosen), of_draws = WindowError(groups, drawn);
  EXPECT_GT(of_draws, 0.04);  // sqrt(1/4 * 7/8 / 64) = 0.058
  EXPECT_LT(error, 0.5 * of_draws);
}

TEST(FacingBalanceTest, DensitiesOfMergedPhotonsErrLessThanDrawnDirectionsWould) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 50021, /*seed=*/5);
  const auto builder = MakeCpuBuilder();
  const auto map = *builder->Build(photons, {});
  std::vector<float> normals;
  Random random(6);
  for (int i = 0; i < 2000; ++i) {
    const Vec3 n = RandomUnit(random);
    normals.insert(normals.end(), {n.x, n.y, n.z});
  }
  const auto positions = MakeQueries(photons, 2000, /*seed=*/7);
  const GatherQueries queries{.positions = positions, .normals = normals};
  const GatherOptions options{.k = 500, .outputs = kOutputDensity};
  const auto exact = *map->Gather(queries, options);
  for (const std::uint32_t size : {4u, 16u}) {
    const Photons fewer = MergePhotons(*map->ReadTree(), photons, size);
    const MapOfFewer merged{*builder->Build(fewer, {}), MeanPower(fewer)};
    const auto answer = *GatherMerged(*map, merged, queries, options);
    double squares = 0;
    for (std::size_t i = 0; i < 2000; ++i) {
      const auto sum = [i](const GatherResult& result) {
        return double{result.densities[3 * i]} + result.densities[3 * i + 1] +
               result.densities[3 * i + 2];
      };
      const double error = sum(answer) / sum(exact) - 1;
      squares += error * error;
    }
    // Half of the light is before a normal: of m photons with Epanechnikov's weights, drawn.
    const double drawn = std::sqrt(4.0 / 3 * GroupSize(*map, *merged.map) / 500);
    EXPECT_LT(std::sqrt(squares / 2000), 0.75 * drawn) << size;
    EXPECT_GT(std::sqrt(squares / 2000), 0.01 * drawn) << size;
  }
}

TEST(FacingBalanceTest, PhotonsOfAWallStayBeforeIt) {
  Photons photons = MakeCloud(CloudNamed("coplanar"), 5003, /*seed=*/8);
  Random random(9);
  for (std::size_t i = 0; i < photons.size(); ++i) {
    Vec3 d = RandomUnit(random);
    d.y = -std::max(std::fabs(d.y), 0.01f);
    const auto direction = EncodeOctahedral(d);
    std::copy(direction.begin(), direction.end(), &photons.directions[2 * i]);
  }
  const auto tree = *(*MakeCpuBuilder()->Build(photons, {}))->ReadTree();
  const Photons merged = MergePhotons(tree, photons, 16);
  for (std::size_t i = 0; i < merged.size(); ++i) {
    ASSERT_TRUE(Faces({merged.directions[2 * i], merged.directions[2 * i + 1]}, {0, 1, 0}));
  }
}

}  // namespace
}  // namespace treelight
