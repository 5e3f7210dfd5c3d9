#ifndef TREELIGHT_SERVER_SMALL_FILE_H_
#define TREELIGHT_SERVER_SMALL_FILE_H_

#include <sys/types.h>

#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace treelight::server {

/// A file that was read whole.
struct SmallFile {
  std::string text;
  mode_t mode;  ///< its permissions
};

/// What `error` of errno says of `file`, of which `what` tells the use: NOT_FOUND where there is
/// none, else PERMISSION_DENIED.
absl::Status FileError(std::string_view what, std::string_view file, int error);

/// Reads the whole of `file`, 1 MiB at most; does not wait for who writes into a pipe. Messages
/// begin with `what` and the file's name. Errors as FileError; PERMISSION_DENIED: it is no regular
/// file; INVALID_ARGUMENT: it is larger.
absl::StatusOr<SmallFile> ReadSmallFile(std::string_view what, const std::string& file);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_SMALL_FILE_H_
