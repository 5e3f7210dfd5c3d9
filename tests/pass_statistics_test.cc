#include "client/render/pass_statistics.h"

#include <cmath>
#include <numbers>
#include <random>

#include "client/render/radius_probe.h"
#include "client/render/shrinking_radius.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

TEST(ShrinkingRadius, FollowsTheRecurrence) {
  ShrinkingRadius radius;
  EXPECT_EQ(radius.squared_scale(), 1);
  radius.Advance();
  EXPECT_DOUBLE_EQ(radius.squared_scale(), 5.0 / 6);
  radius.Advance();
  EXPECT_DOUBLE_EQ(radius.squared_scale(), 5.0 / 6 * 8 / 9);
  // The product is Gamma(N + 2/3) / (Gamma(5/3) Gamma(N + 1)), about N^(-1/3) / Gamma(5/3).
  for (int pass = 3; pass < 100'000; ++pass) radius.Advance();
  EXPECT_NEAR(radius.squared_scale(), std::pow(1e5, -1.0 / 3) / std::tgamma(5.0 / 3), 1e-7);
}

TEST(ShrinkingRadius, ShrinksFromTheLastConstantPassOn) {
  ShrinkingRadius radius(3);
  for (int pass = 1; pass <= 3; ++pass, radius.Advance()) EXPECT_EQ(radius.squared_scale(), 1);
  EXPECT_DOUBLE_EQ(radius.squared_scale(), (3 + 2.0 / 3) / 4);  // of the fourth
}

TEST(ShrinkingRadius, NeighboursShrinkWithTheArea) {
  const EstimateOptions first{.k = 100, .radius = 0.5f, .kernel = DensityKernel::kCone};
  const EstimateOptions quarter = Shrink(first, 0.25);
  EXPECT_EQ(quarter.k, 25u);
  EXPECT_FLOAT_EQ(quarter.radius, 0.25f);
  EXPECT_EQ(quarter.kernel, DensityKernel::kCone);
  EXPECT_EQ(Shrink(first, 1e-6).k, kMinShrunkNeighbors);
  EXPECT_EQ(Shrink({.k = 0, .radius = 1}, 0.01).k, 0u);  // all within the radius still
  EXPECT_EQ(Shrink({.k = 2, .radius = 1}, 0.01).k, 2u);
  EXPECT_EQ(QuarterOf(first).k, 25u);
  EXPECT_FLOAT_EQ(QuarterOf(first).radius, 0.25f);
}

// Two samples a pixel of a picture of 5 x 3: its lattice has 3 x 2 pixels.
TEST(RadiusProbe, LooksAtTheLatticeAlone) {
  const SampleOrder order(5, 3, 2);
  RadiusProbe probe(order, 5, 3);
  GatherPoints points;
  constexpr std::uint64_t kFirst = 4;  // sample 0 of the batch
  for (std::uint32_t i = 0; kFirst + i < order.size(); ++i) {
    points.positions.insert(points.positions.end(), {float(i), 1, 2});
    points.normals.insert(points.normals.end(), {0, 0, float(i)});
    points.samples.push_back(i);
    points.weights.push_back({float(i), 1, 1});
  }
  const GatherPoints selected = probe.Select(points, kFirst);
  std::size_t expected = 0;
  for (std::uint64_t i = kFirst; i < order.size(); ++i)
    expected += order.At(i).x % 2 == 0 && order.At(i).y % 2 == 0;
  ASSERT_EQ(selected.size(), expected);
  for (std::size_t i = 0; i < selected.size(); ++i) {
    const PixelSample place = order.At(kFirst + selected.samples[i]);
    EXPECT_TRUE(place.x % 2 == 0 && place.y % 2 == 0);
    EXPECT_EQ(selected.positions[3 * i], selected.samples[i]);
    EXPECT_EQ(selected.normals[3 * i + 2], selected.samples[i]);
    EXPECT_EQ(selected.weights[i].r, selected.samples[i]);
  }

  for (std::uint64_t i = 0; i < order.size(); ++i) {
    const auto pixel = static_cast<float>(order.At(i).pixel);
    probe.AddWhole(i, {pixel, 1, 0});
    probe.AddQuarter(i, {3 * pixel, 1, 2});
  }
  const Image difference = probe.Difference();
  ASSERT_EQ(difference.width, 3);
  ASSERT_EQ(difference.height, 2);
  for (int i = 0; i < 6; ++i) {
    const auto pixel = static_cast<float>(i / 3 * 2 * 5 + i % 3 * 2);
    EXPECT_EQ(difference.pixels[i], (Rgb{2 * pixel, 0, 2})) << i;
  }
}

// By hand: a pixel of 1, 2 and 6 has the mean 3, the variance 7, and the mean of three the variance
// 7 / 3.
TEST(PassStatistics, MeanAndVarianceAreThoseOfTheWorkedExample) {
  PassStatistics statistics(1, 1);
  for (const float value : {1, 2, 6}) {
    Image pass(1, 1);
    pass.pixels[0] = {value, 0, 2 * value};
    statistics.Add(pass, 1, nullptr);
  }
  EXPECT_EQ(statistics.passes(), 3u);
  EXPECT_EQ(statistics.Mean().pixels[0], (Rgb{3, 0, 6}));
  const ErrorEstimate error = statistics.Estimate();
  EXPECT_NEAR(error.variance, (7.0 / 3 / 9.01 + 4 * 7.0 / 3 / 36.01) / 3, 1e-12);
  EXPECT_FALSE(error.knows_bias);
  EXPECT_EQ(error.squared_bias, 0);
  EXPECT_DOUBLE_EQ(error.relative_rms(), std::sqrt(error.variance));
}

/// The share of the Epanechnikov kernel of radius 1 beyond a straight edge at distance `t` >= 0.
double ShareBeyond(double t) {
  if (t >= 1) return 0;
  // Primitive of (1 - x^2)^(3/2), to which the kernel adds up along the edge but for a factor.
  const auto primitive = [](double x) {
    return x * (5 - 2 * x * x) * std::sqrt(1 - x * x) / 8 + 3.0 / 8 * std::asin(x);
  };
  return 8 / (3 * std::numbers::pi) * (primitive(1) - primitive(t));
}

TEST(PassStatistics, RimShareIsThatOfTheKernel) {
  constexpr int kSteps = 10'000;
  double whole = 0, difference = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double t = (i + 0.5) / kSteps;
    whole += std::pow(ShareBeyond(t), 2);
    difference += std::pow(ShareBeyond(t) - ShareBeyond(2 * t), 2);
  }
  EXPECT_NEAR(ShareBeyond(0), 0.5, 1e-12);
  EXPECT_NEAR(difference / whole, PassStatistics::kRimShare, 1e-4);
  EXPECT_NEAR(std::sqrt(PassStatistics::kCurveShare * PassStatistics::kRimShare),
              PassStatistics::kDifferenceShare, 1e-4);
}

/// Passes whose noise and blur are known: L (1 - blur * share beyond the left edge of the picture)
/// where blur is of a rim, L + blur * s of either sign where the light curves; + sigma Z.
struct Synthetic {
  enum class Blur { kRim, kCurve };
  Blur kind = Blur::kRim;
  double radiance = 2, blur = 0.3, sigma = 0.2;
  int width = 61, height = 40;  // an odd width: the lattice has a pixel at its end

  double Bias(int x, double s) const {
    if (kind == Blur::kCurve) return (x % 4 < 2 ? 1 : -1) * blur * s;
    const double radius = 0.9 * width * std::sqrt(s);
    return -radiance * blur * ShareBeyond((x + 0.5) / radius);
  }

  struct Outcome {
    ErrorEstimate estimate;
    double measured_mse = 0;
  };

  Outcome Run(int passes, std::uint32_t seed) const {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    PassStatistics statistics(width, height);
    ShrinkingRadius radius;
    for (int pass = 0; pass < passes; ++pass, radius.Advance()) {
      const double s = radius.squared_scale();
      Image image(width, height), difference((width + 1) / 2, (height + 1) / 2);
      const auto value = [&](double mean) {
        return static_cast<float>(mean + sigma * normal(random) / std::sqrt(s));
      };
      for (std::size_t i = 0; i < image.pixels.size(); ++i) {
        const int x = static_cast<int>(i) % width;
        const auto light = static_cast<float>(radiance);
        const double bias = Bias(x, s);
        image.pixels[i] = {light + value(bias), light + value(bias), light + value(bias)};
      }
      for (std::size_t i = 0; i < difference.pixels.size(); ++i) {
        const int x = static_cast<int>(i) % difference.width * 2;
        const double change = Bias(x, s / 4) - Bias(x, s);
        difference.pixels[i] = {value(change), value(change), value(change)};
      }
      statistics.Add(image, s, &difference);
    }
    Image truth(width, height);
    truth.pixels.assign(truth.pixels.size(), Rgb{2, 2, 2});
    return {statistics.Estimate(), Compare(statistics.Mean(), truth)->relative_mse};
  }
};

TEST(PassStatistics, TellNoiseAndBlurApart) {
  const std::uint32_t fresh = std::random_device{}();
  for (const std::uint32_t seed : {1u, 2u, fresh}) {
    SCOPED_TRACE(seed);
    for (const int passes : {8, 50}) {
      const auto noise = Synthetic{.blur = 0}.Run(passes, seed);
      EXPECT_NEAR(noise.estimate.variance, noise.measured_mse, 0.1 * noise.measured_mse);
      // Where there is none, the estimate scatters about 0 by 13 % of the noise.
      EXPECT_LT(noise.estimate.squared_bias, (seed == fresh ? 0.65 : 0.25) * noise.measured_mse);
      // Of blur alone it is known how far the estimate is off.
      for (const auto kind : {Synthetic::Blur::kRim, Synthetic::Blur::kCurve}) {
        const double share =
            kind == Synthetic::Blur::kRim ? PassStatistics::kRimShare : PassStatistics::kCurveShare;
        const auto blur = Synthetic{.kind = kind, .blur = 0.1, .sigma = 0}.Run(passes, seed);
        EXPECT_TRUE(blur.estimate.knows_bias);
        const double expected = share / PassStatistics::kDifferenceShare * blur.measured_mse;
        EXPECT_NEAR(blur.estimate.squared_bias, expected, 0.1 * expected);
        // Passes of different radii differ by their blur, which counts as a little noise.
        EXPECT_LT(blur.estimate.variance, 0.02 * blur.measured_mse);
        // Both parts together.
        const auto both = Synthetic{.kind = kind, .blur = 0.1, .sigma = 0.05}.Run(passes, seed);
        const double noise_mse = both.measured_mse - blur.measured_mse;
        EXPECT_NEAR(both.estimate.variance, noise_mse, 0.3 * noise_mse);
        EXPECT_NEAR(both.estimate.squared_bias, expected, 0.3 * expected);
      }
    }
  }
}

// Where the differences are noise alone they must not add up to a blur.
TEST(PassStatistics, NoiseOfTheProbeIsNoBlur) {
  double sum = 0;
  constexpr int kRuns = 40;
  for (std::uint32_t seed = 1; seed <= kRuns; ++seed) {
    const auto run = Synthetic{.blur = 0, .sigma = 1, .width = 16, .height = 16}.Run(8, seed);
    sum += run.estimate.squared_bias / run.measured_mse;
  }
  // The square of the mean of all differences would be 2.9 times the noise.
  EXPECT_LT(sum / kRuns, 0.25);
}

}  // namespace
}  // namespace treelight::client
