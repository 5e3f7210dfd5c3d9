#ifndef TREELIGHT_SERVER_FILE_HANDLE_H_
#define TREELIGHT_SERVER_FILE_HANDLE_H_

#include <unistd.h>

#include <utility>

namespace treelight::server {

/// An open file or socket, closed when it goes.
class FileHandle {
 public:
  FileHandle() = default;
  explicit FileHandle(int handle) : handle_(handle) {}
  FileHandle(FileHandle&& other) noexcept : handle_(std::exchange(other.handle_, -1)) {}
  FileHandle& operator=(FileHandle&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~FileHandle() {
    if (handle_ >= 0) close(handle_);
  }

  int get() const { return handle_; }  ///< -1: none
  int Release() { return std::exchange(handle_, -1); }

 private:
  int handle_ = -1;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_FILE_HANDLE_H_
