#ifndef TREELIGHT_CLIENT_SCENES_FILE_BYTES_H_
#define TREELIGHT_CLIENT_SCENES_FILE_BYTES_H_

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"

namespace treelight::client {

/// The largest file that ReadFileBytes reads, unpacked, bytes.
inline constexpr std::uint64_t kMaxSceneFileSize = std::uint64_t{1} << 30;

/// The bytes of a file; one whose name ends in .xz is unpacked (liblzma).
///
/// Messages begin with `path`. NOT_FOUND, PERMISSION_DENIED and the like: it cannot be read.
/// INVALID_ARGUMENT: it is a folder, pipe or device, or is not xz, is damaged or ends early.
/// RESOURCE_EXHAUSTED: it has or unpacks to more than `max_size` bytes; never more than that is
/// held.
absl::StatusOr<std::string> ReadFileBytes(const std::string& path,
                                          std::uint64_t max_size = kMaxSceneFileSize);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_FILE_BYTES_H_
