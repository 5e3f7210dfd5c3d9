#include "server/small_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>

#include "fmt/format.h"
#include "server/file_handle.h"

namespace treelight::server {
namespace {

constexpr std::size_t kLargestFile = 1 << 20;

}  // namespace

absl::Status FileError(std::string_view what, std::string_view file, int error) {
  const std::string message = fmt::format("{} '{}': {}", what, file, std::strerror(error));
  return error == ENOENT ? absl::NotFoundError(message) : absl::PermissionDeniedError(message);
}

absl::StatusOr<SmallFile> ReadSmallFile(std::string_view what, const std::string& file) {
  // The opening of a pipe would wait for a writer.
  const FileHandle handle(open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status {};
  if (handle.get() < 0 || fstat(handle.get(), &status) != 0) return FileError(what, file, errno);
  if (!S_ISREG(status.st_mode)) {
    return absl::PermissionDeniedError(fmt::format("{} '{}' is no regular file", what, file));
  }
  SmallFile small{.text = {}, .mode = status.st_mode};
  char buffer[4096];
  ssize_t count = 0;
  while (small.text.size() <= kLargestFile &&
         (count = read(handle.get(), buffer, sizeof(buffer))) != 0) {
    if (count > 0) {
      small.text.append(buffer, static_cast<std::size_t>(count));
    } else if (errno != EINTR) {
      return FileError(what, file, errno);
    }
  }
  if (small.text.size() > kLargestFile) {
    return absl::InvalidArgumentError(
        fmt::format("{} '{}': larger than {} bytes", what, file, kLargestFile));
  }
  return small;
}

}  // namespace treelight::server
