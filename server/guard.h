#ifndef TREELIGHT_SERVER_GUARD_H_
#define TREELIGHT_SERVER_GUARD_H_

#include <exception>
#include <new>
#include <string>

#include "absl/status/status.h"
#include "server/break_switch.h"

namespace treelight::server {

/// What `work` returns, an absl::Status; what it throws ends the request it belongs to and not the
/// server: RESOURCE_EXHAUSTED where host memory has run out, INTERNAL for all else, which would be
/// a fault of this program or of a driver.
template <typename Work>
absl::Status Guard(Work work) {
  try {
    return work();
  } catch (const std::bad_alloc&) {
    if (Broken("device_failure")) throw;
    return absl::ResourceExhaustedError(
        "the server's memory has run out; repeat later, or ask for less");
  } catch (const std::exception& error) {
    if (Broken("device_failure")) throw;
    return absl::InternalError(std::string("the server has failed: ") + error.what());
  }
}

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_GUARD_H_
