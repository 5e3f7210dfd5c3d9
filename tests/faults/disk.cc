#include "tests/faults/disk.h"

#include <fcntl.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <system_error>
#include <utility>

#include "fmt/format.h"

namespace treelight::faults {
namespace {

constexpr const char* kFiller = "/filler";

/// Mounts of its own for this process: root may have them, and others as roots of a namespace of
/// users, in which they are who they were.
bool OwnMounts() {
  if (unshare(CLONE_NEWNS) == 0) return true;
  const auto user = getuid(), group = getgid();
  if (unshare(CLONE_NEWUSER | CLONE_NEWNS) != 0) return false;
  std::ofstream("/proc/self/setgroups") << "deny";
  std::ofstream("/proc/self/uid_map") << fmt::format("{} {} 1", user, user);
  std::ofstream("/proc/self/gid_map") << fmt::format("{} {} 1", group, group);
  return true;
}

}  // namespace

Disk::Disk(std::string path, std::uint64_t bytes) : path_(std::move(path)) {
  std::filesystem::create_directories(path_);
  if (!OwnMounts()) return;
  mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr);
  const std::string size = fmt::format("size={},mode=0700", bytes);
  small_ = mount("none", path_.c_str(), "tmpfs", 0, size.c_str()) == 0;
}

Disk::~Disk() {
  if (small_) umount2(path_.c_str(), MNT_DETACH);
}

void Disk::Fill(std::uint64_t bytes_left) {
  struct statvfs disk {};
  if (statvfs(path_.c_str(), &disk) != 0) return;
  const std::uint64_t room = std::uint64_t{disk.f_bavail} * disk.f_frsize;
  const int filler = open((path_ + kFiller).c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
  if (filler < 0) return;
  if (room > bytes_left) {
    (void)!posix_fallocate(filler, 0, static_cast<off_t>(room - bytes_left));
  }
  close(filler);
}

void Disk::Free() { unlink((path_ + kFiller).c_str()); }

std::vector<std::string> Disk::Files() const {
  std::vector<std::string> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(path_, error)) {
    if (entry.path().filename() != kFiller + 1) files.push_back(entry.path().filename());
  }
  std::ranges::sort(files);
  return files;
}

std::optional<Damage> Disk::DamageOne(std::mt19937& random) {
  auto files = Files();
  std::erase_if(files, [](const std::string& file) { return !file.ends_with(".tlmap"); });
  if (files.empty()) return std::nullopt;
  const std::string& file = files[random() % files.size()];
  const std::size_t at = file.rfind('@');
  Damage damage{.start = 0, .end = 0, .name = file.substr(0, at), .version = 0};
  std::from_chars(&file[at + 1], file.data() + file.size(), damage.version);
  const int handle = open((path_ + "/" + file).c_str(), O_RDWR | O_CLOEXEC);
  struct stat status {};
  if (handle < 0 || fstat(handle, &status) != 0 || status.st_size == 0) {
    if (handle >= 0) close(handle);
    return std::nullopt;
  }
  const auto offset = static_cast<off_t>(random() % static_cast<std::uint64_t>(status.st_size));
  switch (random() % 5) {
    case 0:
      (void)!ftruncate(handle, offset);
      break;
    case 1: {
      char byte = 0;
      (void)!pread(handle, &byte, 1, offset);
      byte = static_cast<char>(byte ^ (1 << random() % 8));
      (void)!pwrite(handle, &byte, 1, offset);
      break;
    }
    default: {
      // As of a page that was never written.
      const std::string zeros(std::min<std::size_t>(4096, status.st_size - offset), '\0');
      (void)!pwrite(handle, zeros.data(), zeros.size(), offset);
      break;
    }
  }
  close(handle);
  return damage;
}

}  // namespace treelight::faults
