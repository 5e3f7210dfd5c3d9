// What `treelight estimators` measures, against what can be calculated.

#include "client/estimators/estimators.h"

#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "client/estimators/float_sums.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

using Key = std::tuple<std::string, std::uint32_t, RadiusChoice, DensityKernel>;
constexpr DensityKernel kKernels[] = {DensityKernel::kConstant, DensityKernel::kCone,
                                      DensityKernel::kEpanechnikov};
constexpr RadiusChoice kChoices[] = {RadiusChoice::kNearest, RadiusChoice::kFixed};

/// Rows of 1e4 photons in each surface, by k, choice and kernel.
std::map<Key, EstimatorRow> Measure(const EstimatorPlan& plan) {
  std::map<Key, EstimatorRow> rows;
  const auto builder = MakeCpuBuilder();
  const auto status = MeasureEstimators(*builder, plan, [&](const EstimatorRow& row) {
    rows[{row.place, row.k, row.choice, row.kernel}] = row;
    return absl::OkStatus();
  });
  EXPECT_TRUE(status.ok()) << status;
  return rows;
}

const std::map<Key, EstimatorRow>& Rows() {
  static const auto rows =
      Measure({.photons = {10'000}, .ks = {10, 50}, .seed = 1, .total_photons = 1'000'000});
  return rows;
}

/// Mean of the squared weight of a photon at a uniform place of the disc.
double SquaredWeight(DensityKernel kernel) {
  switch (kernel) {
    case DensityKernel::kConstant:
      return 1;
    case DensityKernel::kCone:
      return 1.5;  // the integral of 9 (1 - sqrt(u))^2
    case DensityKernel::kEpanechnikov:
      return 4.0 / 3;  // of 4 (1 - u)^2
  }
  return 0;
}

/// What the mean estimate is in a plane. The k nearest: R^2 is that of the k-th, whose inverse has
/// a mean of pi density / (k - 1) (Moore and Yackel 1977). All k photons count by the constant
/// kernel; by the others the k-th weighs nothing, and the mean is right.
double PlaneBias(std::uint32_t k, RadiusChoice choice, DensityKernel kernel) {
  const bool counts_kth = kernel == DensityKernel::kConstant && choice == RadiusChoice::kNearest;
  return counts_kth ? 1.0 / (k - 1) : 0;
}

/// The deviation in a plane: a Poisson sum within a fixed radius; of the k nearest from the second
/// moment of 1 / R^2, pi^2 density^2 / ((k - 1) (k - 2)).
double PlaneDeviation(std::uint32_t k, RadiusChoice choice, DensityKernel kernel) {
  if (choice == RadiusChoice::kFixed) return std::sqrt(SquaredWeight(kernel) / k);
  if (kernel == DensityKernel::kConstant) return k / ((k - 1.0) * std::sqrt(k - 2.0));
  return std::sqrt(SquaredWeight(kernel) / (k - 2.0));
}

void ExpectBias(const EstimatorRow& row, double bias, double standard_errors = 4) {
  EXPECT_NEAR(row.bias, bias, standard_errors * row.standard_error + 1e-6)
      << row.place << ", k " << row.k << ", " << NameOf(row.choice) << ", " << NameOf(row.kernel);
}

TEST(EstimatorsTest, APlaneIsEstimatedAsTheorySays) {
  for (const std::uint32_t k : {10u, 50u}) {
    for (const RadiusChoice choice : kChoices) {
      for (const DensityKernel kernel : kKernels) {
        const EstimatorRow& row = Rows().at({"plane", k, choice, kernel});
        ExpectBias(row, PlaneBias(k, choice, kernel));
        const double deviation = PlaneDeviation(k, choice, kernel);
        EXPECT_NEAR(row.deviation, deviation, 0.12 * deviation)
            << k << " " << NameOf(choice) << " " << NameOf(kernel);
        EXPECT_NEAR(row.rms, std::hypot(row.bias, row.deviation), 1e-9);
      }
    }
  }
}

// At a border half of the disc is empty; in a corner of three walls a quarter of a disc lies on
// each.
TEST(EstimatorsTest, BordersAndCornersLoseWhatTheDiscLoses) {
  for (const std::uint32_t k : {10u, 50u}) {
    for (const DensityKernel kernel : kKernels) {
      const auto expect = [&](const char* place, double part) {
        ExpectBias(Rows().at({place, k, RadiusChoice::kFixed, kernel}), part - 1);
        const double mean = part * (1 + PlaneBias(k, RadiusChoice::kNearest, kernel));
        ExpectBias(Rows().at({place, k, RadiusChoice::kNearest, kernel}), mean - 1);
      };
      expect("edge", 0.5);
      expect("corner_2", 1);
      expect("corner_3", 0.75);
    }
  }
}

// A sphere has as much area within R of a point on it as a plane, up to its diameter (Archimedes):
// no kernel is biased. Of one of a third of R all photons are within: 4/9 of a disc's, at u =
// (d/R)^2 uniform in [0, 4/9].
TEST(EstimatorsTest, SpheresAreUnbiasedUpToTheirDiameter) {
  const std::map<DensityKernel, double> small = {
      {DensityKernel::kConstant, 4.0 / 9},
      {DensityKernel::kCone, 3 * (4.0 / 9 - 2.0 / 3 * 8.0 / 27)},
      {DensityKernel::kEpanechnikov, 2 * (4.0 / 9 - 8.0 / 81)}};
  for (const DensityKernel kernel : kKernels) {
    for (const std::uint32_t k : {10u, 50u}) {
      ExpectBias(Rows().at({"sphere", k, RadiusChoice::kFixed, kernel}), 0);
    }
    // At k 50 the radius that is rounded to whole photons matters least.
    ExpectBias(Rows().at({"small_sphere", 50, RadiusChoice::kFixed, kernel}), small.at(kernel) - 1,
               5);
    // It has too few photons: the radius grows until it has those of other spheres.
    EXPECT_LT(Rows().at({"small_sphere", 50, RadiusChoice::kNearest, kernel}).bias, -0.9);
  }
}

// The fixed radius blurs the peak over a Gaussian of 2 sigma^2 = 8e-4: with s = R^2 / 8e-4 its mean
// is (1 - e^-s) / s of the caustic's share. The k nearest have a smaller radius there.
TEST(EstimatorsTest, AFixedRadiusBlursCaustics) {
  constexpr double kPhotons = 10'000, kPeak = kPhotons / 32 / (2 * M_PI * 4e-4);
  const double s = FixedRadius(kPhotons, 50) * FixedRadius(kPhotons, 50) / 8e-4;
  const double blurred = (kPhotons / 2 + kPeak * (1 - std::exp(-s)) / s) / (kPhotons / 2 + kPeak);
  const auto& fixed = Rows().at({"peak", 50, RadiusChoice::kFixed, DensityKernel::kConstant});
  ExpectBias(fixed, blurred - 1);
  const auto& nearest =
      Rows().at({"peak", 50, RadiusChoice::kNearest, DensityKernel::kEpanechnikov});
  EXPECT_LT(fixed.bias, -0.5);
  EXPECT_GT(nearest.bias, fixed.bias + 0.2);
}

TEST(EstimatorsTest, AFreshSeedSaysTheSame) {
  const std::uint32_t seed = std::random_device{}();
  SCOPED_TRACE(seed);
  const auto rows =
      Measure({.photons = {1'000}, .ks = {10}, .seed = seed, .total_photons = 400'000});
  for (const RadiusChoice choice : kChoices) {
    for (const DensityKernel kernel : kKernels) {
      ExpectBias(rows.at({"plane", 10, choice, kernel}), PlaneBias(10, choice, kernel), 6);
    }
    ExpectBias(rows.at({"edge", 10, choice, DensityKernel::kCone}), -0.5, 6);
  }
}

TEST(EstimatorsTest, WhatWouldReachAnotherBorderIsLeftOut) {
  const auto rows =
      Measure({.photons = {1'000}, .ks = {10, 400}, .seed = 1, .total_photons = 8'000});
  EXPECT_TRUE(rows.contains({"plane", 10, RadiusChoice::kFixed, DensityKernel::kCone}));
  EXPECT_FALSE(rows.contains({"plane", 400, RadiusChoice::kFixed, DensityKernel::kCone}));
  EXPECT_TRUE(rows.contains({"peak", 400, RadiusChoice::kFixed, DensityKernel::kCone}));
}

double SumOf(const std::string& name, const std::vector<float>& addends) {
  const auto sum = MakeFloatSum(name);
  sum->Add(addends);
  return sum->Total();
}

// 2^24 + 1 is no float32.
TEST(FloatSumTest, AFloatStopsGrowing) {
  const std::vector<float> ones((1u << 24) + 5000, 1.0f);
  EXPECT_EQ(SumOf("float", ones), 0x1p24);
  for (const char* name : {"lanes_32", "pairwise", "compensated", "double"}) {
    EXPECT_NEAR(SumOf(name, ones), 0x1p24 + 5000, 2) << name;
  }
}

TEST(FloatSumTest, PiecesAreAddedAsTheWholeIs) {
  std::vector<float> addends(10'007);
  MakeAddends(0, /*seed=*/3, addends);
  for (const std::string& name : FloatSumNames()) {
    const auto sum = MakeFloatSum(name);
    for (std::size_t first = 0; first < addends.size(); first += 333) {
      sum->Add(
          std::span(addends).subspan(first, std::min<std::size_t>(333, addends.size() - first)));
    }
    EXPECT_EQ(sum->Total(), SumOf(name, addends)) << name;
    const double exact = std::accumulate(addends.begin(), addends.end(), 0.0);
    EXPECT_NEAR(sum->Total(), exact, 1e-4 * exact) << name;
  }
}

TEST(FloatSumTest, AddendsAreThoseOfADensity) {
  std::vector<float> addends(100'000);
  MakeAddends(0, /*seed=*/3, addends);
  const double mean = std::accumulate(addends.begin(), addends.end(), 0.0) / 1e5;
  EXPECT_NEAR(mean, 1, 4 * 0.66 / std::sqrt(1e5));  // weights of mean 1, powers of mean 1
  for (const float addend : addends) ASSERT_TRUE(addend >= 0 && addend <= 3);
  std::vector<float> later(7);
  MakeAddends(41, /*seed=*/3, later);
  EXPECT_TRUE(std::equal(later.begin(), later.end(), addends.begin() + 41));
}

TEST(FloatSumTest, RowsTellEveryWayAndTheGather) {
  std::vector<FloatSumRow> rows;
  const auto builder = MakeCpuBuilder("here");
  const auto status =
      MeasureFloatSums(*builder, 100'000, 10'000, /*seed=*/1, [&](const FloatSumRow& row) {
        rows.push_back(row);
        return absl::OkStatus();
      });
  ASSERT_TRUE(status.ok()) << status;
  ASSERT_EQ(rows.size(), 4 * FloatSumNames().size() + 3);
  for (const FloatSumRow& row : rows) {
    const bool is_float = row.method == "float" || row.method == "lanes_32";
    EXPECT_LT(row.error, is_float ? 1e-3 : 2e-6) << row.method << " " << row.photons;
    if (row.method == "gather") {
      EXPECT_LT(row.error, 1e-7) << row.photons;  // the CPU adds up in double
      EXPECT_EQ(row.device, "here");
    }
  }
  EXPECT_EQ(rows.back().photons, 10'000u);
}

}  // namespace
}  // namespace treelight::client
