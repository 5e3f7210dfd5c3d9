#ifndef TREELIGHT_SERVER_MACHINE_MEMORY_H_
#define TREELIGHT_SERVER_MACHINE_MEMORY_H_

#include <cstdint>
#include <filesystem>

namespace treelight::server {

/// Bytes of memory that this process may use: what the machine has, or less where a control group
/// (version 2 or 1) of it or of one above says so. 0 where nothing tells. `root` is where /proc and
/// /sys lie.
std::uint64_t MachineMemoryBytes(const std::filesystem::path& root = "/");

/// What --memory-limit is without the flag: half of MachineMemoryBytes(). The rest is for what the
/// budget cannot count: gRPC, the OpenCL runtime and the work space of a build on a CPU, the page
/// cache. 4 GiB where the memory is not known.
std::uint64_t DefaultMemoryLimit(const std::filesystem::path& root = "/");

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_MACHINE_MEMORY_H_
