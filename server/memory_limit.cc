#include "server/memory_limit.h"

#include "core/machine_memory.h"

namespace treelight::server {

std::uint64_t DefaultMemoryLimit(const std::filesystem::path& root) {
  constexpr std::uint64_t kWhereUnknown = std::uint64_t{4} << 30;
  const std::uint64_t bytes = MachineMemoryBytes(root);
  return bytes == 0 ? kWhereUnknown : bytes / 2;
}

}  // namespace treelight::server
