#include "client/trace/dielectric.h"

#include <cmath>

#include "client/scenes/vector.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

const Vec3 kNormal{0, 0, 1};

/// The direction that comes down to the plane z = 0 at `angle` from the normal.
Vec3 Incident(double angle) {
  return {static_cast<float>(std::sin(angle)), 0, static_cast<float>(-std::cos(angle))};
}

TEST(Dielectric, ReflectsFourPercentOfGlassSeenHeadOn) {
  const auto split = SplitAtDielectric(Incident(0), kNormal, 1 / 1.5f);
  EXPECT_NEAR(split.reflectance, 0.04, 1e-6);
  ASSERT_TRUE(split.refracted);
  EXPECT_NEAR(split.refracted->z, -1, 1e-6);
  EXPECT_NEAR(split.reflected.z, 1, 1e-6);
}

TEST(Dielectric, FollowsSnellsLaw) {
  for (const double ior : {0.7, 1.3, 1.5, 2.4}) {
    for (double angle = 0.05; angle < 1.55; angle += 0.1) {
      const double sin_out = std::sin(angle) / ior;
      const auto split = SplitAtDielectric(Incident(angle), kNormal, static_cast<float>(1 / ior));
      ASSERT_EQ(split.refracted.has_value(), sin_out < 1) << ior << " " << angle;
      EXPECT_NEAR(split.reflected.x, std::sin(angle), 1e-6);
      EXPECT_NEAR(split.reflected.z, std::cos(angle), 1e-6);
      if (!split.refracted) continue;
      EXPECT_NEAR(split.refracted->x, sin_out, 1e-5);
      EXPECT_NEAR(split.refracted->z, -std::sqrt(1 - sin_out * sin_out), 1e-4);
    }
  }
}

// Transmitted power by its own amplitudes, 2 cos / (...): with the reflected power it must give 1.
TEST(Dielectric, ReflectedAndTransmittedPowerAreOne) {
  for (const double ior : {1.3, 1.5, 2.4}) {
    for (double angle = 0; angle < 1.57; angle += 0.05) {
      const double cos_in = std::cos(angle);
      const double cos_out = std::sqrt(1 - std::sin(angle) * std::sin(angle) / (ior * ior));
      const double across = 2 * cos_in / (cos_in + ior * cos_out);
      const double along = 2 * cos_in / (ior * cos_in + cos_out);
      const double transmitted = ior * cos_out / cos_in * (across * across + along * along) / 2;
      const auto split = SplitAtDielectric(Incident(angle), kNormal, static_cast<float>(1 / ior));
      EXPECT_NEAR(split.reflectance + transmitted, 1, 2e-5) << ior << " " << angle;
    }
  }
}

// At Brewster's angle light polarised along the plane of incidence is not reflected at all.
TEST(Dielectric, LosesOnePolarisationAtBrewstersAngle) {
  const double ior = 1.5, across = (1 - ior * ior) / (1 + ior * ior);
  const auto split =
      SplitAtDielectric(Incident(std::atan(ior)), kNormal, static_cast<float>(1 / ior));
  EXPECT_NEAR(split.reflectance, across * across / 2, 1e-6);
}

TEST(Dielectric, IsReciprocal) {
  for (double angle = 0; angle < 1.5; angle += 0.05) {
    const auto there = SplitAtDielectric(Incident(angle), kNormal, 1 / 1.5f);
    ASSERT_TRUE(there.refracted);
    const auto back = SplitAtDielectric(-*there.refracted, -kNormal, 1.5f);
    ASSERT_TRUE(back.refracted);
    EXPECT_NEAR(back.reflectance, there.reflectance, 2e-5) << angle;
    EXPECT_NEAR(Length(*back.refracted + Incident(angle)), 0, 1e-4) << angle;
  }
}

TEST(Dielectric, ReflectsAllBeyondTheCriticalAngle) {
  const double critical = std::asin(1 / 1.5);
  EXPECT_TRUE(SplitAtDielectric(Incident(critical - 0.01), kNormal, 1.5f).refracted);
  const auto beyond = SplitAtDielectric(Incident(critical + 0.01), kNormal, 1.5f);
  EXPECT_FALSE(beyond.refracted);
  EXPECT_EQ(beyond.reflectance, 1);
}

}  // namespace
}  // namespace treelight::client
