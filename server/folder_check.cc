#include "server/folder_check.h"

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <system_error>

#include "fmt/format.h"
#include "server/snapshot_folder.h"

namespace treelight::server {

absl::StatusOr<std::size_t> CheckFolder(const std::string& path) {
  if (std::error_code error; !std::filesystem::is_directory(path, error)) {
    const bool none = !error || error == std::errc::no_such_file_or_directory;
    return absl::NotFoundError(
        fmt::format("data folder '{}': {}", path, none ? "there is none" : error.message()));
  }
  const auto folder = SnapshotFolder::Open(path);
  if (!folder.ok()) return folder.status();
  const auto files = (*folder)->CheckAll();
  if (!files.ok()) return files.status();
  const auto set_aside = (*folder)->ListSetAside();
  if (!set_aside.ok()) return set_aside.status();
  std::size_t sound = 0, damaged = 0;
  std::uint64_t photon_count = 0, bytes = 0;
  for (const SnapshotFolder::File& file : *files) {
    if (file.head.ok()) {
      ++sound;
      fmt::print("{}: sound, {} photons\n", file.name, file.head->map.photon_count());
      photon_count += file.head->map.photon_count();
      bytes += file.head->file_bytes;
      continue;
    }
    // What cannot be read may be as sound as the others.
    const bool broken = absl::IsDataLoss(file.head.status());
    damaged += broken ? 1 : 0;
    fmt::print("{}: {}: {}\n", file.name, broken ? "damaged" : "not checked",
               std::string(file.head.status().message()));
  }
  for (const std::string& name : *set_aside) fmt::print("{}: a server has set it aside\n", name);
  const std::size_t unchecked = files->size() - sound - damaged;
  fmt::print("{} maps, {} photons, {} bytes; {} damaged, {} not checked, {} set aside\n", sound,
             photon_count, bytes, damaged, unchecked, set_aside->size());
  return damaged + unchecked + set_aside->size();
}

}  // namespace treelight::server
