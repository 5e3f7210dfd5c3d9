#ifndef TREELIGHT_SERVER_FOLDER_CHECK_H_
#define TREELIGHT_SERVER_FOLDER_CHECK_H_

#include <cstddef>
#include <string>

#include "absl/status/statusor.h"

namespace treelight::server {

/// `treelightd fsck`: checks the data folder and prints a line for each file on stdout. Returns how
/// many are damaged, those included that a server has set aside, or cannot be read: by this user,
/// or by a program before the one that wrote it. Changes nothing. The errors of
/// SnapshotFolder::Open, and NOT_FOUND: there is no such folder.
absl::StatusOr<std::size_t> CheckFolder(const std::string& path);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_FOLDER_CHECK_H_
