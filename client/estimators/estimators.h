#ifndef TREELIGHT_CLIENT_ESTIMATORS_ESTIMATORS_H_
#define TREELIGHT_CLIENT_ESTIMATORS_ESTIMATORS_H_

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/estimators/lit_surface.h"
#include "core/builder.h"

namespace treelight::client {

/// What is measured.
struct EstimatorPlan {
  std::vector<std::uint64_t> photons = {1'000, 10'000, 100'000, 1'000'000, 10'000'000};
  std::vector<std::uint32_t> ks = {10, 50, 100, 400};
  std::uint64_t seed = 1;
  /// Photons of all repetitions of one surface and count together, about: a surface is made
  /// between kLeastTrials and kMostTrials times.
  std::uint64_t total_photons = 4'000'000;
};
inline constexpr std::uint32_t kLeastTrials = 8, kMostTrials = 400;

/// Spheres do not depend on how many photons there are, and are left out beyond as many.
inline constexpr std::uint64_t kMostSpherePhotons = 100'000;

/// How a radius is chosen.
enum class RadiusChoice {
  kNearest,  ///< the distance of the k-th nearest photon
  kFixed,    ///< the one within which a plane of the mean density holds k photons on average
};

/// The densities that one estimator gives at places where the density is known, relative to it.
struct EstimatorRow {
  std::string place;          ///< KnownPlaces::name
  std::uint64_t photons = 0;  ///< of the surface
  std::uint32_t k = 0;
  RadiusChoice choice = RadiusChoice::kNearest;
  DensityKernel kernel = DensityKernel::kEpanechnikov;
  std::uint64_t samples = 0;  ///< estimates
  double bias = 0;            ///< mean - 1
  double standard_error = 0;  ///< of the bias, from the means of independent sets of photons
  double deviation = 0;       ///< standard deviation of one estimate
  double rms = 0;             ///< root of the mean square of estimate - 1
};

using EstimatorListener = std::function<absl::Status(const EstimatorRow& row)>;

/// Measures every surface, count of photons, k, choice of radius and kernel with `builder`'s maps,
/// and tells `listener` the rows. Left out are those whose gathers would reach what the name of the
/// place leaves out. The errors of the builder, of gathers and of the listener.
absl::Status MeasureEstimators(Builder& builder, const EstimatorPlan& plan,
                               const EstimatorListener& listener);

std::string NameOf(RadiusChoice choice);   ///< "nearest", "fixed"
std::string NameOf(DensityKernel kernel);  ///< "constant", "cone", "epanechnikov"

/// The names of the columns, ending with a line's end.
std::string EstimatorCsvHeader();

/// A line, with its end.
std::string EstimatorCsvLine(const EstimatorRow& row);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_ESTIMATORS_ESTIMATORS_H_
