#include "core/machine_memory.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <limits>
#include <string>
#include <string_view>

#include "fmt/format.h"

namespace treelight {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kUnlimited = std::numeric_limits<std::uint64_t>::max();

/// The number in `text`; kUnlimited for anything else, as "max" and what is not there.
std::uint64_t ParseBytes(std::string_view text) {
  std::uint64_t bytes = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), bytes);
  return error == std::errc() ? bytes : kUnlimited;
}

std::uint64_t ReadBytes(const fs::path& file) {
  std::string word;
  std::ifstream(file) >> word;
  return ParseBytes(word);
}

/// "MemTotal:       16384 kB"
std::uint64_t ReadMemTotal(const fs::path& root) {
  std::ifstream file(root / "proc/meminfo");
  std::string key, kib;
  while (file >> key >> kib) {
    if (key == "MemTotal:") {
      const std::uint64_t number = ParseBytes(kib);
      return number == kUnlimited ? kUnlimited : 1024 * number;
    }
    file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
  }
  return kUnlimited;
}

/// The least of `name` in the group `group` below `mount` and in all above it. In a container the
/// group may be the mount's own.
std::uint64_t LeastOfGroups(const fs::path& mount, const fs::path& group, const char* name) {
  std::uint64_t least = ReadBytes(mount / name);
  fs::path folder = mount;
  for (const fs::path& part : group.relative_path()) {
    folder /= part;
    least = std::min(least, ReadBytes(folder / name));
  }
  return least;
}

/// The least limit of this process's control groups: lines as "0::/a/b" and "5:memory:/a/b".
std::uint64_t ReadGroupLimit(const fs::path& root) {
  std::uint64_t least = kUnlimited;
  std::ifstream file(root / "proc/self/cgroup");
  for (std::string line; std::getline(file, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = fmt::format(",{},", line.substr(first + 1, second - first - 1));
    const fs::path group = line.substr(second + 1);
    if (controllers == ",,") {
      least = std::min(least, LeastOfGroups(root / "sys/fs/cgroup", group, "memory.max"));
    } else if (controllers.find(",memory,") != std::string::npos) {
      least = std::min(
          least, LeastOfGroups(root / "sys/fs/cgroup/memory", group, "memory.limit_in_bytes"));
    }
  }
  return least;
}

}  // namespace

std::uint64_t MachineMemoryBytes(const fs::path& root) {
  const std::uint64_t bytes = std::min(ReadMemTotal(root), ReadGroupLimit(root));
  return bytes == kUnlimited ? 0 : bytes;
}

}  // namespace treelight
