#include "client/estimators/estimators.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>
#include <utility>

#include "fmt/format.h"

namespace treelight::client {
namespace {

/// Neighbours at a border are at most so much farther than in a plane: a half of the disc is there.
constexpr double kBorderStretch = 1.45;

/// Sums of the estimates of one row.
class Sums {
 public:
  /// Adds the estimates of one set of photons.
  void Add(const std::vector<double>& estimates) {
    double mean = 0;
    for (const double estimate : estimates) {
      mean += estimate / static_cast<double>(estimates.size());
      sum_ += estimate;
      square_ += (estimate - 1) * (estimate - 1);
    }
    samples_ += estimates.size();
    means_.push_back(mean);
  }

  void Write(EstimatorRow& row) const {
    const auto n = static_cast<double>(samples_);
    row.samples = samples_;
    row.bias = sum_ / n - 1;
    row.rms = std::sqrt(square_ / n);
    row.deviation = std::sqrt(std::max(0.0, square_ / n - row.bias * row.bias));
    double spread = 0, mean = 0;
    const auto trials = static_cast<double>(means_.size());
    for (const double m : means_) mean += m / trials;
    for (const double m : means_) spread += (m - mean) * (m - mean);
    row.standard_error = std::sqrt(spread / (trials - 1) / trials);
  }

 private:
  std::uint64_t samples_ = 0;
  double sum_ = 0, square_ = 0;
  std::vector<double> means_;
};

constexpr RadiusChoice kChoices[] = {RadiusChoice::kNearest, RadiusChoice::kFixed};
constexpr DensityKernel kKernels[] = {DensityKernel::kConstant, DensityKernel::kCone,
                                      DensityKernel::kEpanechnikov};

/// All rows of one kind of surface and one count of photons.
class SurfaceStudy {
 public:
  SurfaceStudy(Builder& builder, SurfaceKind kind, std::uint64_t photons)
      : builder_(builder), kind_(kind), photons_(photons) {}

  /// One set of photons, and the estimates in it for each of `ks`.
  absl::Status AddTrial(const std::vector<std::uint32_t>& ks, std::uint64_t seed) {
    const LitSurface surface = MakeLitSurface(kind_, photons_, ks.front(), seed);
    const auto map = builder_.Build(surface.photons, {});
    if (!map.ok()) return map.status();
    for (const std::uint32_t k : ks) {
      const double radius = FixedRadius(surface.mean_density, k);
      for (std::size_t p = 0; p < surface.places.size(); ++p) {
        if (kBorderStretch * radius > surface.places[p].reach) continue;
        for (const RadiusChoice choice : kChoices) {
          for (const DensityKernel kernel : kKernels) {
            if (auto status = AddEstimates(**map, surface.places[p], k, radius, choice, kernel);
                !status.ok()) {
              return status;
            }
          }
        }
      }
    }
    return absl::OkStatus();
  }

  absl::Status Tell(const EstimatorListener& listener) const {
    for (const auto& [key, sums] : sums_) {
      EstimatorRow row;
      row.photons = photons_;
      std::tie(row.place, row.k, row.choice, row.kernel) = key;
      sums.Write(row);
      if (auto status = listener(row); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

 private:
  absl::Status AddEstimates(const Gatherer& map, const KnownPlaces& places, std::uint32_t k,
                            double radius, RadiusChoice choice, DensityKernel kernel) {
    GatherOptions options{.k = k, .outputs = kOutputDensity, .kernel = kernel};
    if (choice == RadiusChoice::kFixed) {
      options.k = 0;
      options.radius = static_cast<float>(radius);
    }
    const auto answer = map.Gather({.positions = places.queries}, options);
    if (!answer.ok()) return answer.status();
    std::vector<double> estimates;
    for (std::size_t i = 0; i < answer->densities.size(); i += 3) {
      estimates.push_back(answer->densities[i] / places.density);
    }
    sums_[{places.name, k, choice, kernel}].Add(estimates);
    return absl::OkStatus();
  }

  Builder& builder_;
  const SurfaceKind kind_;
  const std::uint64_t photons_;
  std::map<std::tuple<std::string, std::uint32_t, RadiusChoice, DensityKernel>, Sums> sums_;
};

}  // namespace

absl::Status MeasureEstimators(Builder& builder, const EstimatorPlan& plan,
                               const EstimatorListener& listener) {
  for (const std::uint64_t photons : plan.photons) {
    const std::uint64_t trials =
        std::clamp<std::uint64_t>(plan.total_photons / photons, kLeastTrials, kMostTrials);
    for (const SurfaceKind kind : {SurfaceKind::kSquare, SurfaceKind::kCube, SurfaceKind::kCaustics,
                                   SurfaceKind::kSpheres, SurfaceKind::kSmallSpheres}) {
      const bool has_spheres = kind == SurfaceKind::kSpheres || kind == SurfaceKind::kSmallSpheres;
      if (has_spheres && photons > kMostSpherePhotons) continue;
      SurfaceStudy study(builder, kind, photons);
      for (std::uint64_t trial = 0; trial < trials; ++trial) {
        const std::uint64_t seed = plan.seed * 1'000'003 + trial;
        if (!has_spheres) {
          if (auto status = study.AddTrial(plan.ks, seed); !status.ok()) return status;
          continue;
        }
        for (const std::uint32_t k : plan.ks) {  // each has spheres of its own
          if (auto status = study.AddTrial({k}, seed); !status.ok()) return status;
        }
      }
      if (auto status = study.Tell(listener); !status.ok()) return status;
    }
  }
  return absl::OkStatus();
}

std::string NameOf(RadiusChoice choice) {
  return choice == RadiusChoice::kNearest ? "nearest" : "fixed";
}

std::string NameOf(DensityKernel kernel) {
  switch (kernel) {
    case DensityKernel::kConstant:
      return "constant";
    case DensityKernel::kCone:
      return "cone";
    case DensityKernel::kEpanechnikov:
      return "epanechnikov";
  }
  return "unknown";
}

std::string EstimatorCsvHeader() {
  return "place,photons,k,radius,kernel,samples,bias,standard_error,deviation,rms\n";
}

std::string EstimatorCsvLine(const EstimatorRow& row) {
  return fmt::format("{},{},{},{},{},{},{:.6g},{:.3g},{:.6g},{:.6g}\n", row.place, row.photons,
                     row.k, NameOf(row.choice), NameOf(row.kernel), row.samples, row.bias,
                     row.standard_error, row.deviation, row.rms);
}

}  // namespace treelight::client
