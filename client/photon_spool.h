#ifndef TREELIGHT_CLIENT_PHOTON_SPOOL_H_
#define TREELIGHT_CLIENT_PHOTON_SPOOL_H_

#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/model/photons.h"

namespace treelight::client {

/// Photons with powers and directions in a temporary file, 28 bytes each, so that memory does not
/// bound how many there are: first all are appended, then all are read back in the same order. The
/// file goes away with the object.
///
/// Errors carry the system's reason: RESOURCE_EXHAUSTED and the like.
class PhotonSpool {
 public:
  static absl::StatusOr<PhotonSpool> Create();

  absl::Status Append(const Photons& photons);
  std::uint64_t size() const { return size_; }

  /// Calls `use` with the photons in blocks, which it may change. The first error of `use` ends it.
  absl::Status Read(const std::function<absl::Status(Photons& block)>& use);

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::unique_ptr<std::FILE, Close> file_;
  std::uint64_t size_ = 0;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_PHOTON_SPOOL_H_
