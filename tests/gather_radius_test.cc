#include "core/cpu/gather_radius.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "core/builder.h"
#include "core/cpu/lbvh.h"
#include "gtest/gtest.h"
#include "tests/clouds.h"

namespace treelight {
namespace {

float Sample(const Photons& photons, std::uint32_t seed) {
  LooseTree tree;
  if (photons.size() > 0) {
    tree = BuildLbvh(photons.positions, MortonBits::k30, MortonLayout::kCubic, 8);
  }
  return SampleGatherRadius(tree, photons.positions, seed);
}

/// The same by brute force.
float PlainSample(const Photons& photons, std::uint32_t seed) {
  std::vector<float> radii;
  const std::size_t k = std::min<std::size_t>(kRadiusNeighbors, photons.size());
  for (const std::uint32_t id : SamplePhotons(static_cast<std::uint32_t>(photons.size()), seed)) {
    std::vector<float> distances;
    for (std::size_t i = 0; i < photons.size(); ++i) {
      distances.push_back(SquaredDistance(photons.position(id), photons.position(i)));
    }
    std::sort(distances.begin(), distances.end());
    if (distances[k - 1] > 0) radii.push_back(std::sqrt(distances[k - 1]));
  }
  std::sort(radii.begin(), radii.end());
  return radii.empty() ? 0 : radii[radii.size() / 2];
}

TEST(GatherRadiusTest, AgreesWithBruteForce) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t size : {1, 2, 49, 50, 51, 1009}) {
      const Photons photons = MakeCloud(shape, size, /*seed=*/7);
      for (const std::uint32_t seed : {0u, 1u}) {
        EXPECT_EQ(Sample(photons, seed), PlainSample(photons, seed)) << shape.name << " " << size;
      }
    }
  }
  EXPECT_EQ(Sample({}, 0), 0);
}

TEST(GatherRadiusTest, DuplicatesDoNotHideTheOtherPhotons) {
  EXPECT_EQ(Sample(MakeCloud(CloudNamed("all_equal"), 1009, /*seed=*/7), 0), 0);
  const float radius = Sample(MakeCloud(CloudNamed("half_one_duplicate"), 2003, /*seed=*/7), 0);
  EXPECT_GT(radius, 0.1f);  // 50 of 1000 photons of a unit cube: a ball of radius 0.23
  EXPECT_LT(radius, 0.4f);
}

TEST(GatherRadiusTest, SamplesAreSpreadAndDependOnTheSeed) {
  const auto ids = SamplePhotons(1000, 0);
  ASSERT_EQ(ids.size(), kRadiusSamples);
  EXPECT_EQ(ids, SamplePhotons(1000, 0));
  EXPECT_NE(ids, SamplePhotons(1000, 1));
  EXPECT_GT(std::set(ids.begin(), ids.end()).size(), 85u);  // 96 expected
  for (const std::uint32_t id : ids) EXPECT_LT(id, 1000u);
  for (int tenth = 0; tenth < 10; ++tenth) {
    EXPECT_GT(
        std::count_if(ids.begin(), ids.end(),
                      [&](std::uint32_t id) { return id / 100 == static_cast<unsigned>(tenth); }),
        2);
  }
}

}  // namespace
}  // namespace treelight
