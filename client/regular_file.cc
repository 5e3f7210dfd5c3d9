#include "client/regular_file.h"

#include <filesystem>
#include <system_error>

#include "fmt/format.h"

namespace treelight::client {

absl::Status CheckRegularFile(const std::string& path) {
  std::error_code error;
  const auto refuse = [&path](const char* what) {
    return absl::InvalidArgumentError(fmt::format("{}: it is a {}", path, what));
  };
  switch (std::filesystem::status(path, error).type()) {
    case std::filesystem::file_type::directory:
      return refuse("folder");
    case std::filesystem::file_type::fifo:
      return refuse("pipe; give a regular file");
    case std::filesystem::file_type::socket:
      return refuse("socket; give a regular file");
    case std::filesystem::file_type::character:
    case std::filesystem::file_type::block:
      return refuse("device; give a regular file");
    default:
      return absl::OkStatus();
  }
}

}  // namespace treelight::client
