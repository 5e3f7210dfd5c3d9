#ifndef TREELIGHT_SERVER_LOG_FILE_H_
#define TREELIGHT_SERVER_LOG_FILE_H_

#include <mutex>
#include <string>

#include "absl/status/statusor.h"
#include "spdlog/sinks/base_sink.h"

namespace treelight::server {

/// A file that lines are appended to, one write each, and that can be opened anew under its name
/// after somebody has renamed it, as logrotate does. Safe to call from several threads at once.
class LogFile final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  /// PERMISSION_DENIED: `file` cannot be opened or written to, as far as that shows before the
  /// first line; folders are not made.
  static absl::StatusOr<std::shared_ptr<LogFile>> Open(const std::string& file);

  ~LogFile() override;

  /// Opens the name again; lines go to the old file where that fails, with the errors of Open.
  absl::Status Reopen();

 protected:
  void sink_it_(const spdlog::details::log_msg& message) override;
  void flush_() override {}  // nothing is kept

 private:
  LogFile(std::string file, int handle) : file_(std::move(file)), handle_(handle) {}

  const std::string file_;
  int handle_;        // guarded by the base's mutex_
  bool cut_ = false;  // likewise; the file ends within a line, for want of room
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_LOG_FILE_H_
