#ifndef TREELIGHT_CLIENT_ACCURACY_TRUTH_H_
#define TREELIGHT_CLIENT_ACCURACY_TRUTH_H_

#include <cstdint>
#include <span>
#include <vector>

#include "client/accuracy/accuracy_row.h"
#include "core/gatherer.h"
#include "core/model/photons.h"

namespace treelight::client {

/// The right answer to one query, by brute force in float64, with Epanechnikov's kernel.
struct TrueAnswer {
  double distance = 0;  ///< of the k-th photon, or the radius
  double density = 0;   ///< sum of the channels, W / unit^2
};

/// The k nearest photons of each query, or all within `radius` where k is 0, in float64, by TBB in
/// the arena of the caller. Where queries have normals, densities are of the photons that come
/// against them; their radii are not read.
std::vector<TrueAnswer> ComputeTruth(const Photons& photons, const GatherQueries& queries,
                                     std::uint32_t k, float radius);

/// Root mean square over queries of |density / exact density - 1|, of the sum of the channels; 0
/// where both are 0, 1 where only the exact one is.
double DensityError(const GatherResult& answer, const GatherResult& exact);

/// How far the answers to the first truth.size() queries are from the truth. A neighbour is right
/// where it is no farther, in float64, than the true k-th, but for float's rounding.
/// @param photons  of the scene, all
/// @param queries  [3m] as they were asked, m >= truth.size()
/// @param answer   with radii and densities; with neighbours where k > 0, but of fewer photons
/// @param k        of the gather that was asked for; 0: within a radius
AnswerError CompareAnswers(const Photons& photons, std::span<const float> queries,
                           const GatherResult& answer, std::span<const TrueAnswer> truth,
                           std::uint32_t k);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_ACCURACY_TRUTH_H_
