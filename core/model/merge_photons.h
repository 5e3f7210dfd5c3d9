#ifndef TREELIGHT_CORE_MODEL_MERGE_PHOTONS_H_
#define TREELIGHT_CORE_MODEL_MERGE_PHOTONS_H_

#include <cstdint>

#include "core/model/photons.h"
#include "core/model/tree.h"

namespace treelight {

/// Fewer photons that carry the light of all: every maximal subtree of at most `group_size` photons
/// becomes one, leaves of more are cut at the median of their widest side (compare the photons of
/// inner nodes of Spencer and Jones 2009, "Hierarchical Photon Mapping"). Groups follow the boxes
/// of the tree, so that they do not reach across its gaps.
///
/// A merged photon has the sum of the powers, as far as floats reach, and lies at their centroid,
/// weighted by the sum of the magnitudes of the channels. Its direction is that of one of the
/// group, chosen with these weights so that what normals leave out is nearly right over
/// neighbouring groups together (facing_balance.h). A group of one photon stays what it is. The
/// same tree and photons give the same, bit by bit.
/// @param photons     what the tree was built over, with powers; their positions are not read
/// @param group_size  [1, 2^16]
Photons MergePhotons(const Tree& tree, const Photons& photons, std::uint32_t group_size);

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_MERGE_PHOTONS_H_
