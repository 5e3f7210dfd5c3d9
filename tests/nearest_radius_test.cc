#include <vector>

#include "client/render/gather_radius.h"
#include "client/render/map_upload.h"
#include "client/scenes/cornell.h"
#include "gtest/gtest.h"
#include "tbb/global_control.h"
#include "tests/photon_renders.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MustIntersect;

class NearestRadiusTest : public ::treelight::testing::PhotonRenders {};

/// `count` photons on the x axis, `spacing` apart.
TracedPhotons MakeLine(std::size_t count, float spacing) {
  TracedPhotons line;
  for (std::size_t i = 0; i < count; ++i) {
    line.indirect.positions.insert(line.indirect.positions.end(),
                                   {spacing * static_cast<float>(i), 0, 0});
    line.indirect.powers.insert(line.indirect.powers.end(), {1, 1, 1});
    line.indirect.directions.insert(line.indirect.directions.end(), {0, 0});
  }
  return line;
}

TEST_F(NearestRadiusTest, IsAQuantileOverThePhotons) {
  const auto radius = [&](const TracedPhotons& photons, std::uint32_t k, double quantile) {
    const auto maps = UploadMaps(*client_, photons, {.name = "line"});
    EXPECT_TRUE(maps.ok()) << maps.status();
    const auto found =
        RadiusOfNearest(*client_, *maps->refs().indirect, photons.indirect, k, quantile);
    EXPECT_TRUE(found.ok()) << found.status();
    return found.value_or(-1);
  };
  // A photon is the nearest to itself; those beside it are one spacing away, but for the two ends.
  EXPECT_EQ(radius(MakeLine(100, 1), 3, 0.5), 1);
  EXPECT_EQ(radius(MakeLine(100, 1), 3, 0.98), 1);
  EXPECT_EQ(radius(MakeLine(100, 1), 3, 1), 2);
  EXPECT_EQ(radius(MakeLine(100, 8), 3, 0.5), 8);  // follows the size of the scene
  EXPECT_EQ(radius(MakeLine(100, 1), 21, 0.5), 10);
  EXPECT_EQ(radius(MakeLine(5000, 1), 3, 0.95), 1);  // more than are asked for
  EXPECT_GT(radius(MakeLine(10, 0), 3, 0.5), 0);     // all at one point
}

// Photons, map and answers do not depend on threads, so neither does a radius that comes of them.
TEST_F(NearestRadiusTest, IsTheSameForAnyNumberOfThreads) {
  const Intersector scene = MustIntersect(MakeCornell());
  std::vector<float> radii;
  for (const std::size_t threads : {1, 2, 8}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    const auto photons = TracePhotons(scene, {.indirect_photons = 20'000, .caustic_photons = 0});
    ASSERT_TRUE(photons.ok()) << photons.status();
    const auto maps = UploadMaps(*client_, *photons, {.name = "cornell"});
    ASSERT_TRUE(maps.ok()) << maps.status();
    const auto radius =
        RadiusOfNearest(*client_, *maps->refs().indirect, photons->indirect, 50, 0.95);
    ASSERT_TRUE(radius.ok()) << radius.status();
    radii.push_back(*radius);
  }
  EXPECT_GT(radii[0], 0);
  EXPECT_EQ(radii[1], radii[0]);
  EXPECT_EQ(radii[2], radii[0]);
}

}  // namespace
}  // namespace treelight::client
