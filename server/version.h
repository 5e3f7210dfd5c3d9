#ifndef TREELIGHT_SERVER_VERSION_H_
#define TREELIGHT_SERVER_VERSION_H_

namespace treelight::server {

/// Of treelightd: the project's, as CMake knows it.
inline constexpr const char* kVersion = TREELIGHT_VERSION;

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_VERSION_H_
