#include "client/trace/lights.h"

#include <array>
#include <cmath>
#include <numbers>

#include "client/scenes/cornell.h"
#include "client/scenes/vector.h"
#include "client/trace/random.h"
#include "client/trace/sampling.h"
#include "client/trace/scatter.h"
#include "gtest/gtest.h"
#include "tests/test_scenes.h"

namespace treelight::client {
namespace {

using ::treelight::testing::MakeClosedBox;
using ::treelight::testing::MustIntersect;

constexpr double kPi = std::numbers::pi;

const PointLight kBulb{.position = {0.5f, 0.5f, 0.5f}, .intensity = {2, 3, 4}};
const PointLight kSpot{.position = {0.2f, 0.8f, 0.3f},
                       .intensity = {5, 4, 3},
                       .direction = Normalize({1, -2, 0.5f}),
                       .cone_degrees = 50,
                       .falloff_begin_degrees = 20};
const PointLight kHardSpot{.position = {},
                           .intensity = {1, 1, 1},
                           .direction = {0, 0, 1},
                           .cone_degrees = 35,
                           .falloff_begin_degrees = 35};

TEST(Lights, PowerAndDensityAreThoseOfTheTriangles) {
  const Lights lights(MakeCornell());
  EXPECT_NEAR(lights.power().r, kPi * 0.25 * 18, 1e-4);
  EXPECT_NEAR(lights.power().b, kPi * 0.25 * 11, 1e-4);
  for (const double u : {0.0, 0.3, 0.5, 0.99999994}) {
    const LightPoint point = lights.Sample(u, 0.25f);
    EXPECT_FLOAT_EQ(point.density, 4);  // 1 / area
    EXPECT_EQ(point.normal, (Vec3{0, -1, 0}));
    EXPECT_NEAR(point.position.y, 2, 1e-4);
    EXPECT_LT(point.position.y, 2);
    EXPECT_LE(std::max(std::abs(point.position.x), std::abs(point.position.z)), 0.2501f);
  }
}

// The power of a point light is the integral of its intensity.
TEST(PointLight, HasThePowerOfItsIntensity) {
  EXPECT_NEAR(PowerOf(kBulb).g, 4 * kPi * 3, 1e-4);
  EXPECT_NEAR(PowerOf(kHardSpot).g, 2 * kPi * (1 - std::cos(35 * kPi / 180)), 1e-5);
  PointLight lopsided = kBulb;  // shines everywhere, but less to the back
  lopsided.falloff_begin_degrees = 60;
  for (const PointLight& light : {kBulb, kSpot, kHardSpot, lopsided}) {
    double power = 0;
    constexpr int kSteps = 200'000;
    for (int i = 0; i < kSteps; ++i) {
      const auto cosine = static_cast<float>(-1 + (2 * i + 1.0) / kSteps);
      power += IntensityTowards(light, DirectionAround(light.direction, cosine, 0.3f)).r * 4 * kPi /
               kSteps;
    }
    EXPECT_NEAR(power, PowerOf(light).r, 1e-4 * power);
  }
}

TEST(PointLight, FallsSmoothlyToTheRim) {
  const auto at = [](double degrees) {
    const auto cosine = static_cast<float>(std::cos(degrees * kPi / 180));
    return IntensityTowards(kSpot, DirectionAround(kSpot.direction, cosine, 0.6f)).r;
  };
  EXPECT_EQ(at(0), 5);
  EXPECT_EQ(at(19.9), 5);
  const double middle = std::acos((std::cos(20 * kPi / 180) + std::cos(50 * kPi / 180)) / 2);
  EXPECT_NEAR(at(middle * 180 / kPi), 2.5, 1e-4);
  EXPECT_LT(at(49.5), 0.02);
  EXPECT_EQ(at(50.1), 0);
}

// Directions fall into ten rings of equal power as often, and the density says so.
TEST(PointLight, DirectionsFollowTheIntensity) {
  for (const PointLight& light : {kBulb, kSpot, kHardSpot}) {
    const LightPoint point{.position = light.position, .point = &light};
    RandomStream random(1, RandomPurpose::kPhotonPath, 0);
    constexpr int kDraws = 100'000;
    double inverse_density = 0, cosines = 0;
    for (int i = 0; i < kDraws; ++i) {
      const float u = random.Uniform(), v = random.Uniform();
      const Vec3 direction = SampleDirection(point, u, v);
      const float density = DirectionDensity(point, direction);
      ASSERT_GT(density, 0);
      // PowerTowards / density is what SampleEmission gives every photon.
      EXPECT_NEAR(IntensityTowards(light, direction).r / density, PowerOf(light).r,
                  1e-4 * PowerOf(light).r);
      inverse_density += Dot(direction, light.direction) > 0.9f ? 1 / density / kDraws : 0;
      cosines += Dot(direction, light.direction) / double{kDraws};
    }
    // The solid angle of the cap, found by the density.
    EXPECT_NEAR(inverse_density, 2 * kPi * 0.1, 0.01 * 2 * kPi * 0.1 + 0.02 * (&light == &kBulb));
    double mean = 0, norm = 0;
    for (int i = 0; i < 20'000; ++i) {
      const auto cosine = static_cast<float>(-1 + (2 * i + 1.0) / 20'000);
      const float intensity =
          IntensityTowards(light, DirectionAround(light.direction, cosine, 0)).r;
      mean += intensity * cosine, norm += intensity;
    }
    EXPECT_NEAR(cosines, mean / norm, 0.006);
  }
}

// Of lights of very different power each has its share of photons, and all the light is there.
TEST(Lights, AreDrawnByTheirPower) {
  Scene scene = MakeCornell();
  scene.point_lights = {kBulb, kSpot};
  const Lights lights(scene);
  const auto sum = [](const Rgb& c) { return c.r + c.g + c.b; };
  EXPECT_NEAR(lights.power().g, kPi * 0.25 * 15 + PowerOf(kBulb).g + PowerOf(kSpot).g, 1e-3);
  std::array<int, 3> counts{};
  constexpr int kDraws = 100'000;
  double red = 0, blue = 0;
  for (int i = 0; i < kDraws; ++i) {
    const Emission photon = SampleEmission(lights, (i + 0.5) / kDraws, 0.5f, 0.5f, 0.5f);
    red += photon.power.r / double{kDraws}, blue += photon.power.b / double{kDraws};
    EXPECT_NEAR(sum(photon.power), sum(lights.power()), 1e-3 * sum(photon.power));
    ++counts[photon.ray.origin == kBulb.position ? 1 : photon.ray.origin == kSpot.position ? 2 : 0];
  }
  EXPECT_NEAR(red, lights.power().r, 1e-4 * red);
  EXPECT_NEAR(blue, lights.power().b, 1e-4 * blue);
  EXPECT_NEAR(counts[1], kDraws * sum(PowerOf(kBulb)) / sum(lights.power()), 2);
  EXPECT_NEAR(counts[2], kDraws * sum(PowerOf(kSpot)) / sum(lights.power()), 2);
}

// A million lights: every one is drawn where the numbers are fine enough, also the dim ones.
TEST(Lights, FindsEachOfVeryMany) {
  Scene scene;
  constexpr int kCount = 1'000'000;
  for (int i = 0; i < kCount; ++i) {
    const float intensity = i % 2 == 0 ? 1e-3f : 1;
    scene.point_lights.push_back({.position = {static_cast<float>(i), 0, 0},
                                  .intensity = {intensity, intensity, intensity}});
  }
  const Lights lights(scene);
  const double all = kCount / 2 * 1.001;
  for (int i = 0; i < kCount; i += 9'973) {
    const double before = i / 2 * 1.001 + (i % 2) * 0.001, own = i % 2 == 0 ? 0.001 : 1;
    const LightPoint point = lights.Sample((before + own / 2) / all, 0.5f);
    EXPECT_EQ(point.position.x, static_cast<float>(i));
    EXPECT_NEAR(point.probability, own / all, 1e-3 * own / all);
  }
}

TEST(SampleDirectLight, GivesTheIrradianceOfAPointLight) {
  Scene scene = MakeClosedBox({.name = "grey", .reflectance = {0.5f, 0.5f, 0.5f}});
  scene.point_lights = {kSpot};
  const Intersector intersector = MustIntersect(scene);
  const Lights lights(intersector.scene());
  const Vec3 target{0.5f, 0, 0.4f};
  const auto hit = intersector.Intersect({{0.5f, 0.9f, 0.4f}, {0, -1, 0}});
  ASSERT_TRUE(hit);
  const auto light = SampleDirectLight(intersector, lights, *hit, 0.7f, 0.2f);
  ASSERT_TRUE(light);
  const Vec3 path = kSpot.position - target;
  EXPECT_NEAR(Length(light->direction - Normalize(path)), 0, 1e-4);
  EXPECT_EQ(light->density, 0);
  const float expected = IntensityTowards(kSpot, -Normalize(path)).r / Dot(path, path);
  EXPECT_GT(expected, 1);
  EXPECT_NEAR(light->irradiance.r, expected, 1e-3 * expected);
  // Behind the cone, and behind the surface.
  const auto ceiling = intersector.Intersect({{0.1f, 0.5f, 0.1f}, {0, 1, 0}});
  EXPECT_FALSE(SampleDirectLight(intersector, lights, *ceiling, 0.7f, 0.2f));
}

// The density of a direction is that of the light point, seen from the surface: what MIS needs.
TEST(SampleDirectLight, TellsTheDensityOfItsDirection) {
  const Intersector intersector = MustIntersect(MakeCornell());
  const Lights lights(intersector.scene());
  const auto hit = intersector.Intersect({{0.1f, 1, 0.9f}, {0, -1, 0}});
  ASSERT_TRUE(hit);
  for (const float u : {0.1f, 0.45f, 0.8f}) {
    const auto light = SampleDirectLight(intersector, lights, *hit, u, 0.4f);
    ASSERT_TRUE(light);
    const auto lamp = intersector.Intersect(LeaveSurface(*hit, light->direction));
    ASSERT_TRUE(lamp);
    EXPECT_GT(MaxChannel(lamp->material->emission), 0);
    EXPECT_NEAR(lights.Density(*lamp, light->direction, lamp->distance), light->density,
                1e-3 * light->density);
    EXPECT_NEAR(light->irradiance.r * light->density, 18, 0.01);
  }
}

}  // namespace
}  // namespace treelight::client
