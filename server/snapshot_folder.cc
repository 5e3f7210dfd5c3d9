#include "server/snapshot_folder.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/file_handle.h"
#include "server/naming_lock.h"
#include "server/refusal.h"

namespace treelight::server {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;  // ns
constexpr std::string_view kSuffix = ".tlmap", kDamaged = ".damaged", kTemporary = ".tmp";

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

FileId IdOf(const struct stat& status) {
  return {.inode = status.st_ino,
          .changed_ns = status.st_ctim.tv_sec * kSecond + status.st_ctim.tv_nsec,
          .bytes = static_cast<std::uint64_t>(status.st_size)};
}

/// Gives the file `name` of the folder to `use(source, id)`.
template <typename Use>
auto WithSource(int folder, const std::string& name, Use use)
    -> decltype(use(SnapshotBytesSource{}, FileId{})) {
  // The opening of a pipe would wait for a writer.
  constexpr int kFlags = O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK;
  const FileHandle file(openat(folder, name.c_str(), kFlags));
  struct stat status {};
  if (file.get() < 0 || fstat(file.get(), &status) != 0) {
    const int error = errno;
    if (error == ENOENT) return absl::NotFoundError("it is gone");
    if (error == ELOOP) return absl::PermissionDeniedError("it is a symbolic link");
    if (error == EACCES || error == EPERM || error == ENXIO) {
      return absl::PermissionDeniedError(std::strerror(error));
    }
    return absl::UnavailableError(std::strerror(error));
  }
  if (!S_ISREG(status.st_mode)) return absl::DataLossError("it is no regular file");
  return use(Source(file.get(), static_cast<std::uint64_t>(status.st_size)), IdOf(status));
}

/// How much of a file is looked at.
enum class Depth { kHead, kEveryByte };

/// The head of a file that was found right.
SnapshotFolder::File CheckFile(int folder, const std::string& name, Depth depth) {
  SnapshotFolder::File file{.name = name, .id = {}, .head = absl::UnknownError("not read")};
  struct stat entry {};
  if (fstatat(folder, name.c_str(), &entry, AT_SYMLINK_NOFOLLOW) == 0) file.id = IdOf(entry);
  file.head = WithSource(
      folder, name,
      [&](const SnapshotBytesSource& source, const FileId& id) -> absl::StatusOr<SnapshotHead> {
        file.id = id;
        auto head = ReadSnapshotHead(source);
        if (!head.ok()) return head.status();
        const std::string expected = SnapshotName(head->map.name(), head->map.version());
        if (name != expected) {
          return absl::DataLossError(fmt::format("it holds '{}' and has another name", expected));
        }
        if (depth == Depth::kHead) return head;
        if (auto status = CheckSnapshotPhotons(source, *head); !status.ok()) return status;
        return head;
      });
  return file;
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
    if (!renamed_ && !Broken("leftovers")) unlink(path_.c_str());
    close(handle_);
  }
  Aside(const Aside&) = delete;
  Aside& operator=(const Aside&) = delete;

  int handle() const { return handle_; }
  int error() const { return error_; }  ///< where the handle is -1

  /// Gives it its name, unless that is taken. 0 or the error.
  int Rename(const std::string& name) {
    const std::string file = path_.substr(path_.rfind('/') + 1);
    const unsigned flags = Broken("shared_version") ? 0 : RENAME_NOREPLACE;
    if (renameat2(folder_, file.c_str(), folder_, name.c_str(), flags) != 0) return errno;
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

/// Whether the folder has no name any more.
bool IsRemoved(int folder) {
  struct stat status {};
  return fstat(folder, &status) == 0 && status.st_nlink == 0;
}

bool IsSnapshot(std::string_view name) { return name.ends_with(kSuffix); }
bool IsTemporary(std::string_view name) { return name.ends_with(kTemporary); }
bool IsSetAside(std::string_view name) {
  const std::size_t end = name.rfind(kDamaged);  // a number may follow
  return end != std::string_view::npos && IsSnapshot(name.substr(0, end));
}

/// The names of which `is_one` is true, sorted.
absl::StatusOr<std::vector<std::string>> ListNames(int folder, bool (*is_one)(std::string_view)) {
  // A handle of its own, since reading moves it.
  const int handle = openat(folder, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (handle < 0) return absl::InternalError(std::strerror(errno));
  struct Close {
    void operator()(DIR* opened) const { closedir(opened); }
  };
  const std::unique_ptr<DIR, Close> opened(fdopendir(handle));
  if (opened == nullptr) {
    const int error = errno;
    close(handle);
    return absl::InternalError(std::strerror(error));
  }
  std::vector<std::string> names;
  while (true) {
    errno = 0;
    const dirent* const entry = readdir(opened.get());
    if (entry == nullptr && errno != 0) return absl::InternalError(std::strerror(errno));
    if (entry == nullptr) break;
    const std::string_view name = entry->d_name;
    if (is_one(name)) names.emplace_back(name);
  }
  std::ranges::sort(names);
  return names;
}

/// Makes the entry of the new folder `path` last through a loss of power; returns an errno, or 0.
int SyncParent(const std::string& path) {
  const FileHandle handle(open((path + "/..").c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  return handle.get() >= 0 && fsync(handle.get()) == 0 ? 0 : errno;
}

}  // namespace

std::string SnapshotName(std::string_view name, std::uint64_t version) {
  return fmt::format("{}@{}{}", name, version, kSuffix);
}

absl::StatusOr<std::unique_ptr<SnapshotFolder>> SnapshotFolder::Open(const std::string& path,
                                                                     SyncCall sync) {
  const auto failed = [&](int error) {
    return absl::PermissionDeniedError(
        fmt::format("data folder '{}': {}", path, std::strerror(error)));
  };
  if (mkdir(path.c_str(), 0700) == 0) {
    if (const int error = SyncParent(path); error != 0) return failed(error);
  } else if (errno != EEXIST) {
    return failed(errno);
  }
  const int handle = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (handle < 0) return failed(errno);
  return std::unique_ptr<SnapshotFolder>(new SnapshotFolder(path, handle, std::move(sync)));
}

absl::Status SnapshotFolder::CheckWritable() const {
  const Aside probe(handle_, path_, "probe");
  if (probe.handle() >= 0) return absl::OkStatus();
  return absl::PermissionDeniedError(
      fmt::format("data folder '{}': {}", path_, std::strerror(probe.error())));
}

SnapshotFolder::~SnapshotFolder() { close(handle_); }

absl::Status SnapshotFolder::Failed(std::string_view what, int error) const {
  return Failed(what, absl::InternalError(std::strerror(error)));
}

absl::Status SnapshotFolder::Failed(std::string_view what, const absl::Status& error) const {
  if (IsRemoved(handle_)) {
    return absl::InternalError(fmt::format(
        "data folder '{}' was removed while the server runs: maps on the device are served still, "
        "builds fail until the server is started anew",
        path_));
  }
  return absl::Status(error.code(), fmt::format("data folder '{}': {}: {}", path_, what,
                                                std::string(error.message())));
}

absl::StatusOr<std::vector<SnapshotFolder::File>> SnapshotFolder::CheckAll() const {
  const auto names = ListNames(handle_, IsSnapshot);
  if (!names.ok()) return Failed("its list", names.status());
  std::vector<File> files;
  for (const std::string& name : *names) {
    File file = CheckFile(handle_, name, Depth::kEveryByte);
    if (absl::IsNotFound(file.head.status())) continue;  // another server has removed it
    files.push_back(std::move(file));
  }
  return files;
}

absl::StatusOr<std::vector<SnapshotFolder::Entry>> SnapshotFolder::List() const {
  if (IsRemoved(handle_)) return Failed("its list", ENOENT);  // not empty, by which maps would go
  const auto names = ListNames(handle_, IsSnapshot);
  if (!names.ok()) return Failed("its list", names.status());
  std::vector<Entry> entries;
  for (const std::string& name : *names) {
    struct stat status {};
    if (fstatat(handle_, name.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0) {
      entries.push_back({.name = name, .id = IdOf(status)});
    } else if (errno != ENOENT) {  // another server has removed it
      return Failed(name, errno);
    }
  }
  return entries;
}

absl::StatusOr<std::vector<std::string>> SnapshotFolder::ListSetAside() const {
  auto names = ListNames(handle_, IsSetAside);
  if (!names.ok()) return Failed("its list", names.status());
  return names;
}

absl::StatusOr<std::int64_t> SnapshotFolder::Changed() const {
  struct stat status {};
  if (fstat(handle_, &status) != 0) return Failed("fstat", errno);
  return status.st_mtim.tv_sec * kSecond + status.st_mtim.tv_nsec;
}

SnapshotFolder::File SnapshotFolder::ReadHead(const Entry& entry) const {
  return CheckFile(handle_, entry.name, Depth::kHead);
}

void SnapshotFolder::RemoveLeftovers() const {
  if (Broken("leftovers")) return;
  const auto names = ListNames(handle_, IsTemporary);
  if (!names.ok()) return;  // CheckAll tells
  for (const std::string& name : *names) {
    const FileHandle file(
        openat(handle_, name.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
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

absl::StatusOr<std::uint64_t> SnapshotFolder::Write(const v1::PhotonMap& map,
                                                    const std::string& request_id,
                                                    const BuildRequest& request,
                                                    const Photons& photons,
                                                    const Approve& approve) const {
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
  // Before bytes are written for nothing; the rename looks again.
  if (faccessat(handle_, name.c_str(), F_OK, AT_SYMLINK_NOFOLLOW) == 0 && !Broken("shared_version"))
    return absl::AlreadyExistsError(name);
  Aside file(handle_, path_, name);
  if (file.handle() < 0) return failed(file.error());
  int error = 0;
  const auto written =
      WriteSnapshot(map, request_id, request, photons,
                    [&](std::string_view bytes) { return WriteAll(file.handle(), bytes, error); });
  if (!written.ok()) return failed(error);
  if (!Broken("sync_file") && sync_(file.handle()) != 0) return failed(errno);
  struct stat status {};
  if (fstat(file.handle(), &status) != 0) return failed(errno);
  const auto head =
      ReadSnapshotHead(Source(file.handle(), static_cast<std::uint64_t>(status.st_size)));
  if (!head.ok()) return Failed(name, head.status());
  if (Broken("durable_build")) return head->checksum;
  const NamingLock lock(handle_);
  if (auto locked = lock.Take(); !locked.ok()) return locked;
  if (auto approved = approve(); !approved.ok()) return approved;
  if (const int taken = file.Rename(name); taken != 0) {
    if (taken == EEXIST) return absl::AlreadyExistsError(name);
    return failed(taken);
  }
  if (auto synced = Sync(); !synced.ok()) {
    unlinkat(handle_, name.c_str(), 0);
    return synced;
  }
  if (Broken("refused_build") && map.photon_count() % 8 == 0) return failed(ENOSPC);
  return head->checksum;
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

absl::Status SnapshotFolder::Remove(std::string_view name, std::uint64_t version,
                                    std::uint64_t checksum) const {
  const std::string file = SnapshotName(name, version);
  const auto head = CheckFile(handle_, file, Depth::kHead).head;
  if (head.ok() && head->checksum != checksum) return absl::OkStatus();
  if (Broken("durable_delete")) return absl::OkStatus();
  if (unlinkat(handle_, file.c_str(), 0) != 0 && errno != ENOENT) return Failed(file, errno);
  return Sync();
}

absl::StatusOr<Photons> SnapshotFolder::Read(std::string_view name, std::uint64_t version,
                                             std::uint64_t checksum) const {
  const std::string file = SnapshotName(name, version);
  auto photons =
      WithSource(handle_, file,
                 [&](const SnapshotBytesSource& source, const FileId&) -> absl::StatusOr<Photons> {
                   const auto head = ReadSnapshotHead(source);
                   if (!head.ok()) return head.status();
                   if (head->checksum != checksum) return absl::NotFoundError("it is gone");
                   return ReadSnapshotPhotons(source, *head);
                 });
  if (!absl::IsPermissionDenied(photons.status())) return photons;
  return absl::UnavailableError(photons.status().message());  // to the server, not the client
}

absl::Status SnapshotFolder::Sync() const {
  if (!Broken("sync_folder") && sync_(handle_) != 0) return Failed("fsync", errno);
  return absl::OkStatus();
}

}  // namespace treelight::server
