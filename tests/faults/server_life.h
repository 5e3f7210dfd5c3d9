#ifndef TREELIGHT_TESTS_FAULTS_SERVER_LIFE_H_
#define TREELIGHT_TESTS_FAULTS_SERVER_LIFE_H_

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

#include "tests/faults/recorder.h"

namespace treelight::faults {

/// One life of a real server as a process of its own, whose end is written down.
class ServerLife {
 public:
  /// Starts `arguments`, the first of which is the program, and waits until it serves. What it
  /// writes goes to files in `folder`.
  ServerLife(Recorder& recorder, const std::vector<std::string>& arguments,
             const std::string& folder);
  ~ServerLife();  ///< ends it with SIGKILL where nobody has
  ServerLife(const ServerLife&) = delete;
  ServerLife& operator=(const ServerLife&) = delete;

  bool ready() const { return life_.ready != 0; }
  int port() const { return port_; }

  /// Whether the process has ended by itself; then that is written down.
  bool Ended();

  /// Sends `signal` and waits for the end.
  void End(int signal);

  /// What its metrics tell, and the memory of its process; none where they cannot be read.
  std::optional<Quiet> Measure() const;

 private:
  bool Reap(int options);

  Recorder& recorder_;
  const std::string folder_;
  pid_t pid_ = -1;
  int port_ = 0, metrics_port_ = 0;
  Life life_;
};

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_SERVER_LIFE_H_
