#ifndef TREELIGHT_CORE_MODEL_OCTAHEDRAL_H_
#define TREELIGHT_CORE_MODEL_OCTAHEDRAL_H_

#include <array>
#include <cstdint>

#include "core/model/box.h"

namespace treelight {

/// Encodes a unit vector as two 16-bit numbers (Cigolle et al. 2014, "A Survey of Efficient
/// Representations for Independent Unit Vectors", section 3.3: octahedral projection, rounded to
/// the nearest 1/32767). The decoded direction is within 0.003 degrees.
std::array<std::int16_t, 2> EncodeOctahedral(const Vec3& unit);

/// Decodes to a vector of the encoded direction; its L1 norm is 1 but for rounding, it is not
/// normalised. Of any two 16-bit numbers except -32768, which no encoder gives; that is read as
/// -32767.
Vec3 DecodeOctahedral(std::int16_t u, std::int16_t v);

/// Whether light of the octahedral `direction` [2] comes against `normal` [3], so that a gather
/// there counts it: direction . normal < 0.
bool ComesAgainst(const std::int16_t* direction, const float* normal);

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_OCTAHEDRAL_H_
