#ifndef TREELIGHT_CLIENT_TRACE_PHOTON_PATH_H_
#define TREELIGHT_CLIENT_TRACE_PHOTON_PATH_H_

#include <cstdint>
#include <vector>

#include "client/trace/intersector.h"
#include "client/trace/lights.h"
#include "client/trace/photon_tracer.h"
#include "client/trace/targets.h"
#include "core/model/photons.h"

namespace treelight::client {

/// Photons of consecutive paths, and what the paths took. Powers and energy are those of single
/// paths: not yet divided by the number of paths.
struct PhotonBatch {
  Photons photons;
  std::vector<std::uint32_t> stored_until;  ///< photons stored when each path had ended
  EnergyBalance energy;                     ///< of kIndirect
  std::uint64_t rays = 0;
};

/// What all paths of a set share.
struct PhotonPaths {
  const Intersector& intersector;
  const Lights& lights;    ///< at least one
  const Targets* targets;  ///< null: emission is untargeted; else not empty
  PhotonSet set;
  std::uint64_t seed;
  std::uint32_t max_bounces;
  /// kCaustic: the largest share of power that a specular event of the scene lets through. The
  /// first event of a path is survived in proportion to it, so that where all lobes are faint paths
  /// are not lost on them.
  float max_specular = 1;
};

/// PhotonPaths::max_specular of `scene`.
float MaxSpecular(const Scene& scene);

/// Traces path `index` and adds it to `batch`.
void TracePath(const PhotonPaths& paths, std::uint64_t index, PhotonBatch& batch);

/// sum += power, in double.
void Add(Power& sum, const Rgb& power);
void Add(Power& sum, const Power& power);
void Add(EnergyBalance& sum, const EnergyBalance& energy);

/// Multiplies every entry.
void Scale(Power& power, double factor);
void Scale(EnergyBalance& energy, double factor);

/// Adds `more` to the end.
void Append(Photons& photons, const Photons& more);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_PHOTON_PATH_H_
