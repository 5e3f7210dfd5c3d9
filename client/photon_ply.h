#ifndef TREELIGHT_CLIENT_PHOTON_PLY_H_
#define TREELIGHT_CLIENT_PHOTON_PLY_H_

#include <cstdint>
#include <string>
#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/output_file.h"
#include "core/model/photons.h"

namespace treelight::client {

/// Writes `photons` as binary little-endian PLY, a vertex each, in order of index:
///   float x, y, z                               scene units
///   float power_red, power_green, power_blue    W; where there are powers
///   short dir_u, dir_v                          where there are directions: octahedral
///                                               (core/model/octahedral.h)
///   uchar red, green, blue                      where there are powers: the power relative to the
///                                               strongest one, with a gamma of 2.2, so that
///                                               viewers show colours; not read back
/// What is read back is the same bit by bit. Written as an OutputFile, and with its errors.
/// INVALID_ARGUMENT: arrays of unequal length.
absl::Status WritePhotonPly(const std::string& path, const Photons& photons);
/// Likewise to a file that is open already.
absl::Status WritePhotonPly(OutputFile file, const Photons& photons);

/// What is in a PLY file of photons, which its header has to say before the first of them.
struct PhotonPlyContents {
  std::uint64_t count = 0;
  bool powers = true, directions = true;
  float max_power = 0;  ///< the largest channel of all powers, W: what colours are relative to
};

/// Writes what WritePhotonPly does, block by block, however many photons there are. Its errors.
class PhotonPlyWriter {
 public:
  static absl::StatusOr<PhotonPlyWriter> Create(OutputFile file, const PhotonPlyContents& contents);

  /// INVALID_ARGUMENT: arrays of unequal length, or other arrays than announced.
  absl::Status Write(const Photons& block);

  /// Once, and last. INVALID_ARGUMENT: more or fewer photons than announced.
  absl::Status Commit();

 private:
  PhotonPlyWriter(OutputFile file, const PhotonPlyContents& contents)
      : file_(std::move(file)), contents_(contents) {}

  OutputFile file_;
  PhotonPlyContents contents_;
  std::uint64_t written_ = 0;
};

/// What is read of photons, beside their positions.
struct PhotonAttributes {
  bool powers = true, directions = true;
};

/// Reads photons from a PLY file, ASCII or binary: x, y, z, and as the file has them all of
/// power_red, power_green, power_blue, and dir_u, dir_v or nx, ny, nz (a vector of any length but
/// 0; dir_u, dir_v win), where `wanted` has them. Other properties and elements are skipped;
/// doubles are rounded to float32. Errors as PlyReader's; INVALID_ARGUMENT also for a number that
/// is not finite or out of range, and for some but not all of a triple.
absl::StatusOr<Photons> ReadPhotonPly(const std::string& path, const PhotonAttributes& wanted = {});

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_PHOTON_PLY_H_
