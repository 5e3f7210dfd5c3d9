#include "client/trace/scatter.h"

#include <cmath>
#include <numbers>

#include "client/scenes/vector.h"
#include "client/trace/random.h"
#include "client/trace/sampling.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

constexpr double kPi = std::numbers::pi;

const Material kLambert{.name = "lambert", .reflectance = {0.5f, 0.6f, 0.7f}};
const Material kSatin{.name = "satin",
                      .surface = Surface::kGlossy,
                      .reflectance = {0.4f, 0.3f, 0.2f},
                      .specular = {0.5f, 0.4f, 0.3f},
                      .exponent = 20};
const Material kGlass{.name = "glass",
                      .surface = Surface::kDielectric,
                      .reflectance = {},
                      .ior = 1.5f,
                      .transmittance = {0.9f, 0.8f, 0.7f}};
const Material kSheet{.name = "sheet",
                      .surface = Surface::kPane,
                      .reflectance = {},
                      .ior = 1.5f,
                      .transmittance = {0.9f, 0.8f, 0.7f}};

/// The unit direction at `degrees` from +y, in the plane of x and y.
Vec3 At(double degrees) {
  const double a = degrees / 180 * kPi;
  return {static_cast<float>(std::sin(a)), static_cast<float>(std::cos(a)), 0};
}

/// A hit on the plane y = 0 from above; the shading normal leans by `lean` degrees.
Hit HitOn(const Material& material, double lean = 0) {
  return {.position = {}, .normal = {0, 1, 0}, .shading_normal = At(lean), .material = &material};
}

/// The ray that arrives from the direction `from`.
Ray Arriving(const Vec3& from) { return {from, -from}; }

struct Mean {
  double red = 0, shaded_red = 0;  // of the weight, and of the weight with its shading factor
  double absorbed = 0;             // share of the draws
};

Mean MeanWeight(const Ray& ray, const Hit& hit, PathFrom from, Lobes lobes = Lobes::kAll) {
  constexpr int kDraws = 200'000;
  RandomStream random(1, RandomPurpose::kPhotonPath, 0);
  Mean mean;
  for (int i = 0; i < kDraws; ++i) {
    const float u = random.Uniform(), v = random.Uniform();
    const auto scattering = SampleScattering(ray, hit, from, u, v, lobes);
    if (!scattering) {
      mean.absorbed += 1.0 / kDraws;
      continue;
    }
    mean.red += scattering->weight.r / double{kDraws};
    mean.shaded_red += double{scattering->weight.r} * scattering->shading / kDraws;
  }
  return mean;
}

/// Integral of `value(direction)` over the hemisphere above the plane y = 0.
template <typename Value>
double Integrate(Value value) {
  constexpr int kSteps = 400;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      const auto cosine = static_cast<float>((i + 0.5) / kSteps);
      sum += value(DirectionAround({0, 1, 0}, cosine, static_cast<float>((j + 0.5) / kSteps)));
    }
  }
  return sum * 2 * kPi / (kSteps * kSteps);
}

// Sampling and evaluation are two ways to one integral: the mean weight is the integral of the
// value, and the density integrates to the share that is not absorbed.
TEST(Scattering, SamplesWhatItEvaluates) {
  for (const Material* material : {&kLambert, &kSatin}) {
    for (const double lean : {0.0, 25.0, -25.0}) {
      for (const double angle : {5.0, 40.0, 62.0}) {
        for (const Lobes lobes : {Lobes::kAll, Lobes::kDiffuse, Lobes::kSpecular}) {
          const Hit hit = HitOn(*material, lean);
          const Ray ray = Arriving(At(angle));
          const Mean mean = MeanWeight(ray, hit, PathFrom::kCamera, lobes);
          const auto value = [&](const Vec3& d) { return EvaluateScattering(ray, hit, d, lobes); };
          const double reflected = Integrate([&](const Vec3& d) { return value(d).value.r; });
          const double drawn = Integrate([&](const Vec3& d) { return value(d).density; });
          EXPECT_NEAR(mean.red, reflected, 0.005) << material->name << lean << " " << angle;
          EXPECT_NEAR(1 - mean.absorbed, drawn, 0.01) << material->name << lean << " " << angle;
        }
      }
    }
  }
}

TEST(Scattering, TellsTheDensityOfWhatItDraws) {
  const Hit hit = HitOn(kSatin, 10);
  const Ray ray = Arriving(At(30));
  RandomStream random(2, RandomPurpose::kPhotonPath, 0);
  int diffuse = 0, specular = 0;
  for (int i = 0; i < 1000; ++i) {
    const float u = random.Uniform(), v = random.Uniform();
    const auto drawn = SampleScattering(ray, hit, PathFrom::kCamera, u, v);
    if (!drawn) continue;
    ++(drawn->event == Event::kDiffuse ? diffuse : specular);
    const ScatterValue value = EvaluateScattering(ray, hit, drawn->direction);
    EXPECT_NEAR(drawn->density, value.density, 1e-4f * value.density);
  }
  EXPECT_GT(diffuse, 300);
  EXPECT_GT(specular, 300);
}

// f(wi, wo) = f(wo, wi) (Helmholtz); the value holds the cosine of the light's side besides.
TEST(Scattering, IsReciprocal) {
  RandomStream random(3, RandomPurpose::kPhotonPath, 0);
  for (const double lean : {0.0, 20.0}) {
    const Hit hit = HitOn(kSatin, lean);
    for (int i = 0; i < 1000; ++i) {
      const float s = random.Uniform(), t = random.Uniform(), u = random.Uniform(),
                  v = random.Uniform();
      const Vec3 a = CosineDirection({0, 1, 0}, s, t), b = CosineDirection({0, 1, 0}, u, v);
      const float cos_a = Dot(a, hit.shading_normal), cos_b = Dot(b, hit.shading_normal);
      if (cos_a < 0.01f || cos_b < 0.01f) continue;
      const double there = EvaluateScattering(Arriving(a), hit, b).value.g / cos_b;
      const double back = EvaluateScattering(Arriving(b), hit, a).value.g / cos_a;
      EXPECT_NEAR(there, back, 1e-4 * (there + back));
    }
  }
}

// The adjoint of Veach's equation 5.19. Photons from wi reach the solid angle about wo with f
// |wi.Ns| |wo.Ng| / |wi.Ng|: here the share that leaves within a cone about +y, f from the camera's
// side.
TEST(Scattering, PhotonsAreTheAdjointOfCameraPaths) {
  for (const double lean : {0.0, 30.0}) {
    for (const Material* material : {&kLambert, &kSatin}) {
      const Hit hit = HitOn(*material, lean);
      const Vec3 light = At(35), up{0, 1, 0};
      constexpr float kCone = 0.8f;
      constexpr int kDraws = 400'000;
      RandomStream random(4, RandomPurpose::kPhotonPath, 0);
      double photons = 0;
      for (int i = 0; i < kDraws; ++i) {
        const float u = random.Uniform(), v = random.Uniform();
        const auto drawn = SampleScattering(Arriving(light), hit, PathFrom::kLight, u, v);
        if (drawn && Dot(drawn->direction, up) > kCone)
          photons += double{drawn->weight.r} * drawn->shading / kDraws;
      }
      const double expected = Integrate([&](const Vec3& eye) {
        if (eye.y < kCone) return 0.0;
        return double{EvaluateScattering(Arriving(eye), hit, light).value.r} * eye.y / light.y;
      });
      EXPECT_NEAR(photons, expected, 0.01 * expected) << material->name << " leaning " << lean;
    }
  }
}

// As many photons as pass the facet per area, weighted, are the irradiance about the shading
// normal.
TEST(Scattering, ArrivingPhotonsAreWeightedToTheShadingNormal) {
  const Hit hit = HitOn(kLambert, 30);
  const auto cosine = [](double degrees) { return std::cos(degrees / 180 * kPi); };
  EXPECT_NEAR(ArrivalFactor(Arriving(At(40)), hit), cosine(10) / cosine(40), 1e-5);
  EXPECT_EQ(ArrivalFactor(Arriving(At(-61)), hit), 0);
  EXPECT_EQ(ArrivalFactor(Arriving(At(89.99)), hit), kMaxShading);
  EXPECT_FLOAT_EQ(ArrivalFactor(Arriving(At(80)), HitOn(kLambert)), 1);
}

// However the shading normal leans, what reflects stays above the facet and what refracts below.
TEST(Scattering, NothingLeaksThroughTheFacet) {
  const Material mirror{.name = "mirror", .surface = Surface::kMirror, .reflectance = {1, 1, 1}};
  RandomStream random(5, RandomPurpose::kPhotonPath, 0);
  for (const Material* material : {&kLambert, &kSatin, &kGlass, &mirror}) {
    for (const double lean : {-70.0, -40.0, 40.0, 70.0}) {
      const Hit hit = HitOn(*material, lean);
      for (int i = 0; i < 2000; ++i) {
        const float s = random.Uniform(), t = random.Uniform(), u = random.Uniform(),
                    v = random.Uniform();
        const Ray ray = Arriving(CosineDirection({0, 1, 0}, s, t));
        for (const PathFrom from : {PathFrom::kCamera, PathFrom::kLight}) {
          const auto drawn = SampleScattering(ray, hit, from, u, v);
          if (!drawn) continue;
          EXPECT_LE(drawn->shading, kMaxShading);
          EXPECT_GE(drawn->shading, 0);
          // A reflection is on the rays' side of both normals, a refraction on neither's.
          const bool above = drawn->direction.y > 0;
          if (drawn->density == 0) {
            EXPECT_EQ(above, Dot(drawn->direction, hit.shading_normal) > 0);
          }
          if (material != &kGlass) {
            EXPECT_TRUE(above);
          }
        }
      }
    }
  }
}

TEST(Scattering, TransmittanceAbsorbsWhatIsRefracted) {
  const Ray ray = Arriving(At(50));
  const Hit hit = HitOn(kGlass);
  const float reflectance = SplitAtHit(ray, hit).reflectance;
  const Mean mean = MeanWeight(ray, hit, PathFrom::kLight);
  EXPECT_NEAR(mean.red, reflectance + (1 - reflectance) * 0.9, 1e-3);
  EXPECT_EQ(mean.absorbed, 0);
}

// Radiance is (n_from / n_to)^2 times as large on the side of the eye, power is as large on both.
TEST(Scattering, RefractionScalesRadianceAlone) {
  const Ray ray = Arriving(At(20));  // below the critical angle
  const Hit outside = HitOn(kGlass);
  Hit inside = outside;
  inside.front = false;
  const float n = kGlass.ior;
  for (const auto& [hit, scale] : {std::pair{outside, 1 / (n * n)}, {inside, n * n}}) {
    const auto radiance = SampleScattering(ray, hit, PathFrom::kCamera, 0.99f, 0);
    const auto power = SampleScattering(ray, hit, PathFrom::kLight, 0.99f, 0);
    const auto reflected = SampleScattering(ray, hit, PathFrom::kCamera, 0, 0);
    ASSERT_TRUE(radiance && power && reflected);
    EXPECT_LT(Dot(radiance->direction, hit.normal), 0);
    EXPECT_FLOAT_EQ(radiance->radiance_scale, scale);
    EXPECT_EQ(power->radiance_scale, 1);
    EXPECT_EQ(reflected->radiance_scale, 1);
  }
}

TEST(Pane, AClearOneReflectsWhatTheTextbookSays) {
  for (const float cosine : {1.0f, 0.6f, 0.05f}) {
    const Vec3 normal{0, 1, 0}, direction{std::sqrt(1 - cosine * cosine), -cosine, 0};
    const float r = SplitAtDielectric(direction, normal, 1 / 1.5f).reflectance;
    const PaneSplit split = SplitAtPane(cosine, 1.5f, {1, 1, 1});
    EXPECT_NEAR(split.reflected.r, 2 * r / (1 + r), 1e-5) << cosine;
    EXPECT_NEAR(split.passed.g, (1 - r) / (1 + r), 1e-5) << cosine;
  }
  EXPECT_EQ(SplitAtPane(0, 1.5f, {1, 1, 1}).reflected.b, 1);
}

// The geometric series, added order by order.
TEST(Pane, AddsAllOrdersOfReflection) {
  const double r = 0.04, t = 0.7;  // n = 1.5 at right angles
  double inside = 1 - r, reflected = r, passed = 0;
  for (int face = 0; face < 60; ++face) {
    inside *= t;
    (face % 2 == 0 ? passed : reflected) += inside * (1 - r);
    inside *= r;
  }
  const PaneSplit split = SplitAtPane(1, 1.5f, {0.7f, 0.7f, 0.7f});
  EXPECT_NEAR(split.reflected.r, reflected, 1e-5);
  EXPECT_NEAR(split.passed.r, passed, 1e-5);
}

TEST(Pane, IsDrawnInItsProportions) {
  const Ray ray = Arriving(At(60));
  const Hit hit = HitOn(kSheet);
  const PaneSplit split = SplitAtPane(0.5f, 1.5f, kSheet.transmittance);
  double reflected = 0, passed = 0;
  RandomStream random(6, RandomPurpose::kPhotonPath, 0);
  for (int i = 0; i < 100'000; ++i) {
    const float u = random.Uniform();
    const auto drawn = SampleScattering(ray, hit, PathFrom::kLight, u, 0);
    ASSERT_TRUE(drawn);
    EXPECT_EQ(drawn->density, 0);
    if (drawn->event == Event::kPassage) {
      EXPECT_EQ(drawn->direction, ray.direction);
      passed += drawn->weight.b / 1e5;
    } else {
      EXPECT_NEAR(Length(drawn->direction - Reflect(ray.direction, hit.normal)), 0, 1e-6);
      reflected += drawn->weight.b / 1e5;
    }
  }
  EXPECT_NEAR(reflected, split.reflected.b, 0.005);
  EXPECT_NEAR(passed, split.passed.b, 0.005);
}

TEST(BalanceWeight, OfBothDensitiesAddsUpToOne) {
  EXPECT_FLOAT_EQ(BalanceWeight(3, 1), 0.75f);
  EXPECT_FLOAT_EQ(BalanceWeight(3, 1) + BalanceWeight(1, 3), 1);
  EXPECT_EQ(BalanceWeight(0, 5), 1);  // a point light, or a mirror
}

}  // namespace
}  // namespace treelight::client
