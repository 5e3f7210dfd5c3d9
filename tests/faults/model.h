#ifndef TREELIGHT_TESTS_FAULTS_MODEL_H_
#define TREELIGHT_TESTS_FAULTS_MODEL_H_

#include <memory>
#include <vector>

#include "tests/faults/history.h"

// What the numbers of a history stand for, and the right answers by brute force.
namespace treelight::faults {

/// The photons of `set`, on a grid of 32 cells an axis of the unit cube, so that many are equally
/// far from a query.
Photons MakePhotons(const PhotonSet& set);

/// [3 * count] points of the same grid, some of them off it.
std::vector<float> MakeQueries(const QuerySet& set);

GatherOptions MakeOptions(const QuerySet& set);

/// Photons that are ready to be asked by brute force.
std::unique_ptr<const Gatherer> MakeBruteForce(const PhotonSet& set);

/// Whether `result` is, bit for bit, what `photons` answer to `queries`.
bool IsAnswer(const Gatherer& photons, const QuerySet& queries, const GatherResult& result);

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_MODEL_H_
