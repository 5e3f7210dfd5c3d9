#ifndef TREELIGHT_CORE_MODEL_THIN_PHOTONS_H_
#define TREELIGHT_CORE_MODEL_THIN_PHOTONS_H_

#include <cstdint>

#include "core/model/photons.h"

namespace treelight {

/// A random subset of the photons that carries the light of all: of each run of `group_size`
/// photons in the order of upload one stays, chosen by a hash of the run's number, of the last,
/// shorter run one or none, so that all photons are as likely to stay. Powers are multiplied by
/// photons / photons that stay. One of each run, and not each photon for itself, so that their
/// number does not vary, and photons of one path, which are neighbours in the order, seldom stay
/// together. The same photons give the same subset, everywhere.
///
/// A density that n of the photons make has, of the subset, a standard error of about
/// sqrt((group_size - 1) / n) relative to it where powers are alike and all weigh the same, and
/// sqrt(4 / 3) times that with Epanechnikov's kernel over a surface.
/// @param photons     with powers
/// @param group_size  at least 1
Photons ThinPhotons(const Photons& photons, std::uint32_t group_size);

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_THIN_PHOTONS_H_
