#ifndef TREELIGHT_SERVER_SNAPSHOT_FOLDER_H_
#define TREELIGHT_SERVER_SNAPSHOT_FOLDER_H_

#include <unistd.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "server/snapshot.h"

namespace treelight::server {

/// Differs where a file was changed, or another one has its name.
struct FileId {
  std::uint64_t inode = 0;
  std::int64_t changed_ns = 0;  ///< also by chmod
  std::uint64_t bytes = 0;

  friend bool operator==(const FileId&, const FileId&) = default;
};

/// The folder of --data-dir: a file NAME@VERSION.tlmap for each version of a map. Several servers
/// may have the same one. Calls block for the disk. Safe to call from several threads at once.
class SnapshotFolder {
 public:
  /// A file of the folder.
  struct Entry {
    std::string name;  ///< without the folder
    FileId id;
  };
  /// What one file holds, or what is wrong with it.
  struct File {
    std::string name;  ///< without the folder
    FileId id;
    /// The errors of ReadSnapshotHead. PERMISSION_DENIED: a symbolic link, or not for this user.
    /// UNAVAILABLE: it cannot be opened at present.
    absl::StatusOr<SnapshotHead> head;
  };
  /// The last word on a snapshot that is written and has no name yet: OK, or why it shall have
  /// none.
  using Approve = std::function<absl::Status()>;

  /// fsync(2), by which a file, or the names in a folder, get to the disk.
  using SyncCall = std::function<int(int handle)>;

  /// Opens `path`, and makes it with mode 0700 where it is missing. `sync` is another fsync for
  /// tests, which lose what it was not asked for. PERMISSION_DENIED: that cannot be.
  static absl::StatusOr<std::unique_ptr<SnapshotFolder>> Open(const std::string& path,
                                                              SyncCall sync = ::fsync);

  ~SnapshotFolder();
  SnapshotFolder(const SnapshotFolder&) = delete;
  SnapshotFolder& operator=(const SnapshotFolder&) = delete;

  /// PERMISSION_DENIED: no file can be made in the folder.
  absl::Status CheckWritable() const;

  /// Reads every byte of every snapshot, in the order of the names. What a writer that was killed
  /// has left is not listed.
  absl::StatusOr<std::vector<File>> CheckAll() const;

  /// The files of snapshots, in the order of the names, and nothing of what is in them.
  absl::StatusOr<std::vector<Entry>> List() const;

  /// The names of files that SetAside has renamed, sorted.
  absl::StatusOr<std::vector<std::string>> ListSetAside() const;

  /// When an entry of the folder was made, renamed or removed last: nanoseconds of its file
  /// system's clock, which may stand for 10 ms or, where it tells whole seconds only, for a second.
  /// Takes microseconds on a local disk.
  absl::StatusOr<std::int64_t> Changed() const;

  /// Reads the head of a file that List told of; its photons are not looked at.
  File ReadHead(const Entry& entry) const;

  /// Removes what writers that were killed have left; writers that live are known by their lock.
  void RemoveLeftovers() const;

  /// Renames a damaged file so that no start meets it again; the new name.
  absl::StatusOr<std::string> SetAside(const std::string& file) const;

  /// Writes a snapshot of `map`: aside, to the disk, renamed, and the folder to the disk. OK: it
  /// survives a loss of power; the checksum of its head. `approve` is asked before it is renamed,
  /// while no other server that has the folder gives a name to a file: what it has seen stays true
  /// until then. (A file system that locks no folders, as NFS, leaves that out.) Its errors;
  /// ALREADY_EXISTS: there is a file of this version already. RESOURCE_EXHAUSTED with Quota::kDisk:
  /// the disk is full. UNAVAILABLE: another server stands still with the lock. INTERNAL: the disk
  /// fails. After an error there is no file of it.
  absl::StatusOr<std::uint64_t> Write(const v1::PhotonMap& map, const std::string& request_id,
                                      const BuildRequest& request, const Photons& photons,
                                      const Approve& approve) const;

  /// Whether the disk has room for `bytes` more at present. RESOURCE_EXHAUSTED with Quota::kDisk.
  absl::Status CheckRoom(std::uint64_t bytes, std::string_view what) const;

  /// Removes the snapshot of a version whose head has this checksum; OK, also where it is gone: it
  /// does not come back after a loss of power. The snapshot of another map stays.
  absl::Status Remove(std::string_view name, std::uint64_t version, std::uint64_t checksum) const;

  /// Reads the photons of a version whose head has this checksum. NOT_FOUND: the file is gone, or
  /// of another map. DATA_LOSS: it is damaged.
  absl::StatusOr<Photons> Read(std::string_view name, std::uint64_t version,
                               std::uint64_t checksum) const;

  const std::string& path() const { return path_; }

 private:
  SnapshotFolder(std::string path, int handle, SyncCall sync)
      : path_(std::move(path)), handle_(handle), sync_(std::move(sync)) {}
  absl::Status Sync() const;
  absl::Status Failed(std::string_view what, int error) const;
  absl::Status Failed(std::string_view what, const absl::Status& error) const;

  const std::string path_;
  const int handle_;  // of the folder
  const SyncCall sync_;
};

/// "NAME@VERSION.tlmap".
std::string SnapshotName(std::string_view name, std::uint64_t version);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_SNAPSHOT_FOLDER_H_
