#ifndef TREELIGHT_TESTS_FAULTS_RUN_H_
#define TREELIGHT_TESTS_FAULTS_RUN_H_

#include <chrono>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/faults/checker.h"
#include "tests/faults/disk.h"
#include "tests/faults/history.h"

namespace treelight::faults {

struct RunOptions {
  std::string server;  ///< path of treelightd
  std::chrono::seconds length{60};
  std::uint32_t seed = 0;  ///< of all that is drawn; threads make each run another one
};

struct RunReport {
  std::vector<Violation> violations;
  std::string summary;  ///< how many calls, kills and faults there were
  std::string history;  ///< as text, what happened
};

/// Starts servers on `disk`, one after the other, lets clients work on them, and does to both what
/// docs/testing.md says. `folder` is for what servers write beside their maps. Stops at the first
/// violation.
RunReport Run(const RunOptions& options, Disk& disk, const std::string& folder);

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_RUN_H_
