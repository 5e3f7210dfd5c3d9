#ifndef TREELIGHT_CLIENT_ESTIMATORS_LIT_SURFACE_H_
#define TREELIGHT_CLIENT_ESTIMATORS_LIT_SURFACE_H_

#include <cstdint>
#include <string>
#include <vector>

#include "core/model/photons.h"

namespace treelight::client {

/// Places of a surface where the density of its photons is known.
struct KnownPlaces {
  std::string name;            ///< see MakeLitSurface
  std::vector<float> queries;  ///< [3m]
  double density = 0;          ///< photons per area of the surface that each place is on
  /// Distance from the places to what changes the neighbourhood that their name says; +inf: nothing
  /// does.
  double reach = 0;
};

/// Photons of 1 W scattered over surfaces, and places on them.
struct LitSurface {
  Photons photons;
  std::vector<KnownPlaces> places;
  double mean_density = 0;  ///< photons per area, what a fixed radius is chosen for
};

/// Kinds of surfaces, with the places on each:
/// a unit square: `plane`, inside, and `edge`, on its border;
/// the walls of a unit cube: `corner_2`, where two walls meet, and `corner_3`, in its corners;
/// a unit square with 16 Gaussian caustics of sigma kCausticSigma that have half of the photons:
/// `peak`, in the middle of a caustic, and `beside`, five sigma from it;
/// far apart spheres whose radius is that of a disc that holds k photons: `sphere`; a third of it:
/// `small_sphere`. These two do not depend on how many photons there are.
enum class SurfaceKind { kSquare, kCube, kCaustics, kSpheres, kSmallSpheres };

inline constexpr double kCausticSigma = 0.02;

/// `photon_count` photons, for spheres about as many, independent and uniform but for caustics; the
/// same for the same seed.
/// @param k  of the gather, for the size of spheres
LitSurface MakeLitSurface(SurfaceKind kind, std::uint64_t photon_count, std::uint32_t k,
                          std::uint64_t seed);

/// The radius within which a plane of that density holds k photons on average.
double FixedRadius(double density, std::uint32_t k);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_ESTIMATORS_LIT_SURFACE_H_
