#ifndef TREELIGHT_CLIENT_STUDY_HARD_INPUTS_H_
#define TREELIGHT_CLIENT_STUDY_HARD_INPUTS_H_

#include <cstdint>
#include <string>
#include <vector>

namespace treelight::client {

/// Photons on which a plain builder makes a poor tree, or wrong answers.
struct HardInput {
  std::string name;              ///< stands for the scene in the rows of the study
  std::vector<float> positions;  ///< [3n]
};

/// About `count` photons each, > 1, the same for the same seed:
/// `uniform`      the unit cube, to compare with
/// `clusters`     two cubes of 0.1, 1000 apart
/// `outlier`      the unit cube and one photon 1e6 away along all axes; `x_outlier`: along x alone
/// `scales`       one of 41 boxes of 2^0 to 2^-40, all in one corner
/// `diagonal`     a line along (1, 1, 1)
/// `duplicates`   half of them at one place
/// `grid`         integer points of a cube
/// `identical`    all at one place
/// `denormal`     a cube of 1e-40
/// `coplanar`     a square in the plane z = 0; `oblique`: in the plane x + y + z = 1
/// `offset`       the unit cube around (1e6, 1e6, 1e6), where floats are 1/16 apart
/// `huge`         coordinates of 3e38, which the service refuses: squared distances would overflow
std::vector<HardInput> MakeHardInputs(std::uint64_t count, std::uint64_t seed);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_STUDY_HARD_INPUTS_H_
