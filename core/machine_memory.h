#ifndef TREELIGHT_CORE_MACHINE_MEMORY_H_
#define TREELIGHT_CORE_MACHINE_MEMORY_H_

#include <cstdint>
#include <filesystem>

namespace treelight {

/// Bytes of memory that this process may use: what the machine has, or less where a control group
/// (version 2 or 1) of it or of one above says so. 0 where nothing tells. `root` is where /proc and
/// /sys lie.
std::uint64_t MachineMemoryBytes(const std::filesystem::path& root = "/");

}  // namespace treelight

#endif  // TREELIGHT_CORE_MACHINE_MEMORY_H_
