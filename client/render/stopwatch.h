#ifndef TREELIGHT_CLIENT_RENDER_STOPWATCH_H_
#define TREELIGHT_CLIENT_RENDER_STOPWATCH_H_

#include <chrono>

namespace treelight::client {

/// Runs from its making on.
class Stopwatch {
 public:
  double Seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_STOPWATCH_H_
