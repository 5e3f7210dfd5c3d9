#ifndef TREELIGHT_CLIENT_BENCH_WORKLOADS_H_
#define TREELIGHT_CLIENT_BENCH_WORKLOADS_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace treelight {

/// A set of points that speed is measured on, and queries near them; the same for the same seed.
struct Workload {
  std::vector<float> positions;  ///< [3n] scene units
  std::vector<float> queries;    ///< [3m] points of the set, moved by a tenth of their mean spacing
};

/// Sets of points in the unit cube, or of its size.
enum class PointSet {
  kUniform,   ///< W1: uniform
  kSurfaces,  ///< W2: as photons lie: on walls and spheres, with caustics and copies
  kTurned,    ///< W3: W2 turned, so that no wall lies along an axis
};

/// "W1", "W2", "W3".
std::string NameOf(PointSet set);

/// Makes `count` points and `query_count` queries in random order.
///
/// W2 has 70 % of its points on the 6 walls of the unit cube and on 3 spheres, uniform by area, and
/// 30 % in 24 Gaussian patches of sigma 0.01 on walls, half of the patches on the wall y = 0; 2 %
/// of all points are exact copies of others. Queries are moved along the surface by a Gaussian of
/// 0.1 of the spacing that as many points have on these surfaces; those of W1 in all directions.
Workload MakeWorkload(PointSet set, std::size_t count, std::size_t query_count, std::uint32_t seed);

/// `points` [3n] in Morton order.
std::vector<float> InMortonOrder(const std::vector<float>& points);

}  // namespace treelight

#endif  // TREELIGHT_CLIENT_BENCH_WORKLOADS_H_
