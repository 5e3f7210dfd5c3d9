#include "server/snapshot_folder.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <utility>

#include "fmt/format.h"
#include "server/refusal.h"

namespace treelight::server {
namespace {

constexpr std::string_view kSuffix = ".tlmap", kDamaged = ".damaged", kTemporary = ".tmp";

/// An open file.
class Handle {
 public:
  explicit Handle(int handle) : handle_(handle) {}
  ~Handle() {
    if (handle_ >= 0) close(handle_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;

  int get() const { return handle_; }

 private:
  const int handle_;
};

SnapshotBytesSource Source(int handle, std::uint64_t size) {
  return {.size = size, .read = [handle](std::uint64_t offset, std::span<char> to) {
            while (!to.empty()) {
              const ssize_t count = pread(handle, to.data(), to.size(), static_cast<off_t>(offset));
              if (count < 0 && errno == EINTR) continue;
              if (count < 0) return absl::DataLossError(std::strerror(errno));
              if (count == 0) return absl::DataLossError("it became shorter");
              offset += static_cast<std::uint64_t>(count);
              to = to.subspan(static_cast<std::size_t>(count));
            }
            return absl::OkStatus();
          }};
}

/// Gives the file `name` of the folder to `use(source)`.
template <typename Use>
auto WithSource(int folder, const std::string& name, Use use)
    -> decltype(use(SnapshotBytesSource{})) {
  const Handle file(openat(folder, name.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
  struct stat status {};
  if (file.get() < 0 || fstat(file.get(), &status) != 0) {
    const int error = errno;
    if (error == ENOENT) return absl::NotFoundError("it is gone");
    return absl::UnavailableError(std::strerror(error));
  }
  if (!S_ISREG(status.st_mode)) return absl::DataLossError("it is no regular file");
  return use(Source(file.get(), static_cast<std::uint64_t>(status.st_size)));
}

/// The head of a file whose every byte was found right.
absl::StatusOr<SnapshotHead> CheckFile(int folder, const std::string& name) {
  return WithSource(
      folder, name, [&](const SnapshotBytesSource& source) -> absl::StatusOr<SnapshotHead> {
        auto head = ReadSnapshotHead(source);
        if (!head.ok()) return head.status();
        const std::string expected = SnapshotName(head->map.name(), head->map.version());
        if (name != expected) {
          return absl::DataLossError(fmt::format("it holds '{}' and has another name", expected));
        }
        if (auto status = CheckSnapshotPhotons(source, *head); !status.ok()) return status;
        return head;
      });
}

/// A file that is written aside; removed where it was not renamed.
class Aside {
 public:
  Aside(int folder, const std::string& folder_path, const std::string& name)
      : folder_(folder),
        path_(fmt::format("{}/{}.XXXXXX{}", folder_path, name, kTemporary)),
        handle_(mkostemps(path_.data(), static_cast<int>(kTemporary.size()), O_CLOEXEC)),
        error_(errno) {
    // Tells RemoveLeftovers that its writer lives.
    if (handle_ >= 0) flock(handle_, LOCK_EX | LOCK_NB);
  }
  ~Aside() {
    if (handle_ < 0) return;
    if (!renamed_) unlink(path_.c_str());
    close(handle_);
  }
  Aside(const Aside&) = delete;
  Aside& operator=(const Aside&) = delete;

  int handle() const { return handle_; }
  int error() const { return error_; }  ///< where the handle is -1

  /// Gives it its name, unless that is taken. 0 or the error.
  int Rename(const std::string& name) {
    const std::string file = path_.substr(path_.rfind('/') + 1);
    if (renameat2(folder_, file.c_str(), folder_, name.c_str(), RENAME_NOREPLACE) != 0)
      return errno;
    renamed_ = true;
    return 0;
  }

 private:
  const int folder_;
  std::string path_;
  const int handle_, error_;
  bool renamed_ = false;
};

absl::Status WriteAll(int handle, std::string_view bytes, int& error) {
  while (!bytes.empty()) {
    const ssize_t count = write(handle, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      error = errno;
      return absl::InternalError("write");
    }
    bytes.remove_prefix(static_cast<std::size_t>(count));
  }
  return absl::OkStatus();
}

std::vector<std::string> List(int folder, std::string_view suffix) {
  std::vector<std::string> names;
  // A handle of its own, since reading moves it.
  DIR* const opened = fdopendir(openat(folder, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (opened == nullptr) return names;
  while (const dirent* entry = readdir(opened)) {
    const std::string_view name = entry->d_name;
    if (name.ends_with(suffix)) names.emplace_back(name);
  }
  closedir(opened);
  std::ranges::sort(names);
  return names;
}

}  // namespace

std::string SnapshotName(std::string_view name, std::uint64_t version) {
  return fmt::format("{}@{}{}", name, version, kSuffix);
}

absl::StatusOr<std::unique_ptr<SnapshotFolder>> SnapshotFolder::Open(const std::string& path) {
  const auto failed = [&](int error) {
    return absl::PermissionDeniedError(
        fmt::format("data folder '{}': {}", path, std::strerror(error)));
  };
  if (mkdir(path.c_str(), 0700) != 0 && errno != EEXIST) return failed(errno);
  const int handle = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (handle < 0) return failed(errno);
  return std::unique_ptr<SnapshotFolder>(new SnapshotFolder(path, handle));
}

absl::Status SnapshotFolder::CheckWritable() const {
  const Aside probe(handle_, path_, "probe");
  if (probe.handle() >= 0) return absl::OkStatus();
  return absl::PermissionDeniedError(
      fmt::format("data folder '{}': {}", path_, std::strerror(probe.error())));
}

SnapshotFolder::~SnapshotFolder() { close(handle_); }

absl::Status SnapshotFolder::Failed(std::string_view what, int error) const {
  return absl::InternalError(
      fmt::format("data folder '{}': {}: {}", path_, what, std::strerror(error)));
}

absl::StatusOr<std::vector<SnapshotFolder::File>> SnapshotFolder::CheckAll() const {
  std::vector<File> files;
  for (std::string& name : List(handle_, kSuffix)) {
    auto head = CheckFile(handle_, name);
    if (absl::IsNotFound(head.status())) continue;  // another server has removed it
    files.push_back({std::move(name), std::move(head)});
  }
  return files;
}

void SnapshotFolder::RemoveLeftovers() const {
  for (const std::string& name : List(handle_, kTemporary)) {
    const Handle file(openat(handle_, name.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW));
    if (file.get() >= 0 && flock(file.get(), LOCK_EX | LOCK_NB) == 0) {
      unlinkat(handle_, name.c_str(), 0);
    }
  }
}

absl::StatusOr<std::string> SnapshotFolder::SetAside(const std::string& file) const {
  constexpr int kTries = 1000;
  for (int i = 0; i < kTries; ++i) {
    const std::string aside =
        fmt::format("{}{}{}", file, kDamaged, i == 0 ? "" : fmt::format(".{}", i));
    if (renameat2(handle_, file.c_str(), handle_, aside.c_str(), RENAME_NOREPLACE) == 0) {
      if (auto status = Sync(); !status.ok()) return status;
      return aside;
    }
    if (errno != EEXIST) return Failed(file, errno);
  }
  return Failed(file, EEXIST);
}

absl::Status SnapshotFolder::Write(const v1::PhotonMap& map, const std::string& request_id,
                                   const Photons& photons) const {
  const std::string name = SnapshotName(map.name(), map.version());
  const auto failed = [&](int error) {
    if (error == ENOSPC || error == EDQUOT) {
      return Refuse(Quota::kDisk,
                    fmt::format("map '{}' with {} photons does not fit the disk of data folder "
                                "'{}'; delete maps, or build a smaller one",
                                map.name(), photons.size(), path_),
                    std::nullopt);
    }
    return Failed(name, error);
  };
  Aside file(handle_, path_, name);
  if (file.handle() < 0) return failed(file.error());
  int error = 0;
  const auto written = WriteSnapshot(map, request_id, photons, [&](std::string_view bytes) {
    return WriteAll(file.handle(), bytes, error);
  });
  if (!written.ok()) return failed(error);
  if (fsync(file.handle()) != 0) return failed(errno);
  if (const int taken = file.Rename(name); taken != 0) {
    if (taken == EEXIST) return absl::AlreadyExistsError(name);
    return failed(taken);
  }
  if (auto status = Sync(); !status.ok()) {
    unlinkat(handle_, name.c_str(), 0);
    return status;
  }
  return absl::OkStatus();
}

absl::Status SnapshotFolder::CheckRoom(std::uint64_t bytes, std::string_view what) const {
  struct statvfs disk {};
  if (fstatvfs(handle_, &disk) != 0) return absl::OkStatus();  // the write will tell
  const std::uint64_t room = std::uint64_t{disk.f_bavail} * disk.f_frsize;
  if (bytes <= room) return absl::OkStatus();
  return Refuse(
      Quota::kDisk,
      fmt::format("{}: its file takes up to {} bytes, the disk of data folder '{}' has {} "
                  "left; delete maps, or build a smaller one",
                  what, bytes, path_, room),
      std::nullopt);
}

absl::Status SnapshotFolder::Remove(std::string_view name, std::uint64_t version) const {
  const std::string file = SnapshotName(name, version);
  if (unlinkat(handle_, file.c_str(), 0) != 0 && errno != ENOENT) return Failed(file, errno);
  return Sync();
}

absl::StatusOr<Photons> SnapshotFolder::Read(std::string_view name, std::uint64_t version) const {
  const std::string file = SnapshotName(name, version);
  auto photons =
      WithSource(handle_, file, [&](const SnapshotBytesSource& source) -> absl::StatusOr<Photons> {
        const auto head = ReadSnapshotHead(source);
        if (!head.ok()) return head.status();
        return ReadSnapshotPhotons(source, *head);
      });
  if (photons.ok() || absl::IsResourceExhausted(photons.status())) return photons;
  return absl::Status(
      photons.status().code(),
      fmt::format("'{}' of the data folder: {}", file, std::string(photons.status().message())));
}

absl::Status SnapshotFolder::Sync() const {
  if (fsync(handle_) != 0) return Failed("fsync", errno);
  return absl::OkStatus();
}

absl::StatusOr<std::size_t> CheckFolder(const std::string& path) {
  if (!std::filesystem::is_directory(path)) {
    return absl::NotFoundError(fmt::format("data folder '{}': there is none", path));
  }
  const auto folder = SnapshotFolder::Open(path);
  if (!folder.ok()) return folder.status();
  const auto files = (*folder)->CheckAll();
  if (!files.ok()) return files.status();
  std::size_t damaged = 0;
  std::uint64_t photon_count = 0, bytes = 0;
  for (const SnapshotFolder::File& file : *files) {
    if (file.head.ok()) {
      fmt::print("{}: sound, {} photons\n", file.name, file.head->map.photon_count());
      photon_count += file.head->map.photon_count();
      bytes += file.head->file_bytes;
    } else {
      ++damaged;
      fmt::print("{}: damaged: {}\n", file.name, std::string(file.head.status().message()));
    }
  }
  fmt::print("{} maps, {} photons, {} bytes; {} damaged\n", files->size() - damaged, photon_count,
             bytes, damaged);
  return damaged;
}

}  // namespace treelight::server
