#ifndef TREELIGHT_CLIENT_ACCURACY_ACCURACY_H_
#define TREELIGHT_CLIENT_ACCURACY_ACCURACY_H_

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/accuracy/accuracy_row.h"
#include "client/photon_map_client.h"
#include "client/scenes/scene.h"

namespace treelight::client {

/// What is measured in one scene.
struct AccuracyPlan {
  std::uint64_t photons = 500'000;          ///< indirect ones
  std::uint64_t caustic_photons = 100'000;  ///< of the pictures, where something makes caustics
  std::uint64_t seed = 1;
  std::uint32_t queries = 50'000;  ///< of the batch that is timed, at random photons
  /// Queries are at random points that the camera sees instead, with their normals, as a renderer
  /// asks for densities.
  bool normals = false;
  std::uint32_t checked = 200;  ///< of them, whose answers are compared with the truth
  std::uint32_t runs = 5;       ///< of each batch; the median counts
  std::vector<std::uint32_t> ks = {50, 500};
  std::vector<double> errors = {0.01, 0.05, 0.2};  ///< that are asked for, [0, 1)
  std::uint32_t batches = 20;           ///< for each of them, whose errors are compared with it
  std::uint32_t batch_queries = 4'000;  ///< of each
  int picture_size = 128;               ///< pixels, width and height; 0: no pictures
  std::uint32_t reference_spp = 256;    ///< samples per pixel of the path-traced reference
};

/// Takes the rows in order; an error ends the measurement.
using AccuracyListener = std::function<absl::Status(const AccuracyRow& row)>;

/// Measures error and speed of every setting of SettingGrid over the photons of `scene`, gathered
/// from the server behind `client`. Pictures are rendered for the settings of the k nearest, with
/// the indirect map gathered so. Maps are deleted at the end, and expire after an hour. Blocks. The
/// errors of Intersector::Create, TracePhotons, PhotonMapClient, PathTrace and the listener.
absl::Status MeasureAccuracy(PhotonMapClient& client, Scene scene, const AccuracyPlan& plan,
                             const AccuracyListener& listener);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_ACCURACY_ACCURACY_H_
