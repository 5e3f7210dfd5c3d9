#include "server/log_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "fmt/format.h"
#include "server/break_switch.h"

namespace treelight::server {
namespace {

/// A handle of `file`, to append. A full device refuses even a write of nothing.
absl::StatusOr<int> OpenToAppend(const std::string& file) {
  const int handle = open(file.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666);
  if (handle >= 0 && write(handle, "", 0) >= 0) return handle;
  const int error = errno;
  if (handle >= 0) close(handle);
  return absl::PermissionDeniedError(fmt::format("log file '{}': {}", file, std::strerror(error)));
}

}  // namespace

absl::StatusOr<std::shared_ptr<LogFile>> LogFile::Open(const std::string& file) {
  const auto handle = OpenToAppend(file);
  if (!handle.ok()) return handle.status();
  return std::shared_ptr<LogFile>(new LogFile(file, *handle));
}

LogFile::~LogFile() { close(handle_); }

absl::Status LogFile::Reopen() {
  if (Broken("log_reopen")) return absl::OkStatus();
  const auto handle = OpenToAppend(file_);
  if (!handle.ok()) return handle.status();
  int old = *handle;
  {
    const std::lock_guard lock(mutex_);
    std::swap(old, handle_);
    cut_ = false;
  }
  close(old);
  return absl::OkStatus();
}

void LogFile::sink_it_(const spdlog::details::log_msg& message) {
  spdlog::memory_buf_t line;
  if (cut_) line.push_back('\n');  // what is there of the last line must not cost this one
  formatter_->format(message, line);
  for (std::size_t written = 0; written < line.size();) {
    const ssize_t count = write(handle_, line.data() + written, line.size() - written);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) {
      cut_ |= written > 0;
      throw spdlog::spdlog_ex(fmt::format("log file '{}'", file_), errno);
    }
    written += static_cast<std::size_t>(count);
  }
  cut_ = false;
}

}  // namespace treelight::server
