#ifndef TREELIGHT_CORE_DEVICE_GUARD_H_
#define TREELIGHT_CORE_DEVICE_GUARD_H_

#include <exception>
#include <functional>
#include <new>
#include <stdexcept>
#include <string>
#include <type_traits>

#include "absl/status/status.h"
#include "core/device/opencl.h"

namespace treelight {

/// Thrown inside core/ with the status that the public function returns.
class StatusError : public std::runtime_error {
 public:
  explicit StatusError(absl::Status status)
      : std::runtime_error(std::string(status.message())), status_(std::move(status)) {}
  const absl::Status& status() const { return status_; }

 private:
  absl::Status status_;
};

/// Throws StatusError, CANCELLED, where `cancelled` says so; an empty one never does.
inline void ThrowIfCancelled(const std::function<bool()>& cancelled) {
  if (cancelled && cancelled()) throw StatusError(absl::CancelledError("cancelled"));
}

/// Translates an OpenCL failure: out of memory is RESOURCE_EXHAUSTED, anything else INTERNAL with
/// call and code.
absl::Status ToStatus(const cl::Error& error);

/// Calls `body`, which returns absl::Status or absl::StatusOr, and turns what it throws into a
/// status. What core/ catches elsewhere is the expected "no" of a single OpenCL call.
template <typename Body>
std::invoke_result_t<Body> Guard(Body&& body) {
  try {
    return body();
  } catch (const StatusError& error) {
    return error.status();
  } catch (const cl::Error& error) {
    return ToStatus(error);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("host memory is exhausted");
  }
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_DEVICE_GUARD_H_
