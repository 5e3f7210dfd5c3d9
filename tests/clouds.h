#ifndef TREELIGHT_TESTS_CLOUDS_H_
#define TREELIGHT_TESTS_CLOUDS_H_

#include <cstdint>
#include <string>
#include <vector>

#include "core/model/photons.h"

namespace treelight {

/// A kind of point set, benign or one that breaks plain implementations (Bulavintsev and Zhdanov
/// 2020 test none).
struct CloudShape {
  std::string name;
  std::vector<float> (*make)(std::size_t count, std::uint32_t seed);  ///< positions [3 * count]
};

/// All shapes: uniform, surfaces with caustics, duplicates, flat, collinear, far apart, far off,
/// caustics 1e5 times as dense as the rest, tiny, huge, as far as coordinates may be.
const std::vector<CloudShape>& AllClouds();

/// The names of all shapes: the parameters of a suite.
std::vector<std::string> CloudNames();

/// The shape of that name; aborts where there is none.
const CloudShape& CloudNamed(const std::string& name);

/// `count` photons of `shape` with random powers and directions.
Photons MakeCloud(const CloudShape& shape, std::size_t count, std::uint32_t seed);

/// Query points for `photons`: photons themselves, points near them, and points far outside; [3 *
/// count].
std::vector<float> MakeQueries(const Photons& photons, std::size_t count, std::uint32_t seed);

}  // namespace treelight

#endif  // TREELIGHT_TESTS_CLOUDS_H_
