#ifndef TREELIGHT_CLIENT_REGULAR_FILE_H_
#define TREELIGHT_CLIENT_REGULAR_FILE_H_

#include <string>

#include "absl/status/status.h"

namespace treelight::client {

/// Refuses what is no regular file, before it is opened: opening a pipe waits for a writer, and a
/// device may never end. INVALID_ARGUMENT: a folder, pipe, socket or device; the message begins
/// with `path`. What is not there or may not be looked at is left to opening it.
absl::Status CheckRegularFile(const std::string& path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_REGULAR_FILE_H_
