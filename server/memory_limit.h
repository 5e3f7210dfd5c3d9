#ifndef TREELIGHT_SERVER_MEMORY_LIMIT_H_
#define TREELIGHT_SERVER_MEMORY_LIMIT_H_

#include <cstdint>
#include <filesystem>

namespace treelight::server {

/// What --memory-limit is without the flag: half of MachineMemoryBytes(). The rest is for what the
/// budget cannot count: gRPC, the OpenCL runtime and the work space of a build on a CPU, the page
/// cache. 4 GiB where the memory is not known. `root` is where /proc and /sys lie.
std::uint64_t DefaultMemoryLimit(const std::filesystem::path& root = "/");

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_MEMORY_LIMIT_H_
