#include "client/output_file.h"

#include <cerrno>
#include <filesystem>
#include <system_error>

#include "fmt/format.h"

namespace treelight::client {

absl::StatusOr<OutputFile> OutputFile::Create(const std::string& path) {
  OutputFile output;
  output.path_ = path;
  if (path == "-") return output;
  std::error_code error;
  if (std::filesystem::exists(path, error)) {
    output.path_ = std::filesystem::canonical(path, error).string();  // a link stays a link
    if (error) return absl::ErrnoToStatus(error.value(), fmt::format("cannot write {}", path));
  }
  const bool replaces = std::filesystem::is_regular_file(output.path_, error);
  if (replaces || !std::filesystem::exists(output.path_, error))
    output.part_ = output.path_ + ".part";
  output.file_.reset(
      std::fopen((output.part_.empty() ? output.path_ : output.part_).c_str(), "wb"));
  if (output.file_ == nullptr) {
    const absl::Status status = output.Error();
    output.part_.clear();  // there is none to remove
    return status;
  }
  return output;
}

OutputFile::~OutputFile() {
  if (file_ != nullptr && !part_.empty()) std::remove(part_.c_str());
}

absl::Status OutputFile::Write(std::string_view bytes) {
  std::FILE* file = file_ != nullptr ? file_.get() : stdout;
  if (std::fwrite(bytes.data(), 1, bytes.size(), file) != bytes.size()) return Error();
  return absl::OkStatus();
}

absl::Status OutputFile::Commit() {
  if (file_ == nullptr) return std::fflush(stdout) == 0 ? absl::OkStatus() : Error();
  if (std::fclose(file_.release()) == 0 &&
      (part_.empty() || std::rename(part_.c_str(), path_.c_str()) == 0)) {
    return absl::OkStatus();
  }
  const absl::Status status = Error();
  if (!part_.empty()) std::remove(part_.c_str());
  return status;
}

absl::Status OutputFile::Error() const {
  return absl::ErrnoToStatus(
      errno, fmt::format("cannot write {}", path_ == "-" ? "standard output" : path_));
}

}  // namespace treelight::client
