#ifndef TREELIGHT_CLIENT_OUTPUT_FILE_H_
#define TREELIGHT_CLIENT_OUTPUT_FILE_H_

#include <cstdio>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace treelight::client {

/// A file that appears under its name only when all of it is written: until Commit it is PATH.part,
/// and without Commit it goes away. Devices and pipes are written directly, and so is "-", which is
/// stdout.
///
/// Errors carry the system's reason and name the file: NOT_FOUND, PERMISSION_DENIED,
/// RESOURCE_EXHAUSTED and the like.
class OutputFile {
 public:
  static absl::StatusOr<OutputFile> Create(const std::string& path);
  OutputFile(OutputFile&&) = default;
  OutputFile& operator=(OutputFile&&) = default;
  ~OutputFile();

  absl::Status Write(std::string_view bytes);
  absl::Status Commit();  ///< once, and last

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };

  OutputFile() = default;
  absl::Status Error() const;  // of the last system call

  std::string path_, part_;                 // part_ is empty where path_ is written directly
  std::unique_ptr<std::FILE, Close> file_;  // null for stdout, and after Commit
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_OUTPUT_FILE_H_
