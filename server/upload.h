#ifndef TREELIGHT_SERVER_UPLOAD_H_
#define TREELIGHT_SERVER_UPLOAD_H_

#include <chrono>
#include <cstdint>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/model/photons.h"
#include "server/chunk_arrays.h"
#include "server/convert.h"

namespace treelight::server {

/// What a map of `plan` takes of its device's memory at least, bytes: its photons.
std::uint64_t DeviceBytes(const BuildPlan& plan);

/// Refuses a map that the device cannot hold, `what` beginning the message: its photons, 16 B each
/// in one buffer, larger than the largest buffer, or with powers and directions larger than the
/// memory that `bytes_used` of other maps leave. RESOURCE_EXHAUSTED with Quota::kDevice, and with
/// `retry_delay` unless an empty device could not hold it.
absl::Status CheckDeviceRoom(const BuildPlan& plan, const DeviceInfo& device,
                             std::uint64_t bytes_used, std::string_view what,
                             std::chrono::milliseconds retry_delay);

/// Host memory of the photons of `plan`, bytes.
std::uint64_t PhotonBytes(const BuildPlan& plan);

/// Host memory of an upload, bytes: its arrays, the message that is added to them and the one that
/// arrives meanwhile.
std::uint64_t UploadBytes(const BuildPlan& plan, const Limits& limits);

/// What a map of `plan` holds of its device's memory while it is built, bytes, a little more rather
/// than less: photons in the order of the tree, its nodes, and 32 B of work space a photon.
std::uint64_t MapBytes(const BuildPlan& plan);

/// Puts the chunks of one upload together; the arrays are reserved in whole at the start.
class Upload {
 public:
  /// Of a plan that passed the limits. RESOURCE_EXHAUSTED: this machine's memory does not hold it.
  static absl::StatusOr<Upload> Start(const BuildPlan& plan, const Limits& limits);

  /// Appends a chunk. INVALID_ARGUMENT: arrays of unequal length, an array missing or not
  /// announced, no photons, more than announced, or a number that is not allowed; the message names
  /// field, index and value, the photon counted over the whole upload. After an error the upload is
  /// of no further use.
  absl::Status Add(const ChunkArrays& chunk);

  /// The photons. INVALID_ARGUMENT: fewer came than announced.
  absl::StatusOr<Photons> Finish() &&;

  std::uint64_t received() const { return photons_.size(); }  ///< photons so far

 private:
  Upload(const BuildPlan& plan, const Limits& limits);

  std::uint64_t expected_;  // photons
  bool has_powers_, has_directions_;
  std::uint64_t max_chunk_bytes_;
  Photons photons_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_UPLOAD_H_
