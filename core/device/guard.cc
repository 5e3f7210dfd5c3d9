#include "core/device/guard.h"

#include "fmt/format.h"

namespace treelight {

absl::Status ToStatus(const cl::Error& error) {
  switch (error.err()) {
    case CL_MEM_OBJECT_ALLOCATION_FAILURE:
    case CL_OUT_OF_RESOURCES:
    case CL_OUT_OF_HOST_MEMORY:
    case CL_INVALID_BUFFER_SIZE:
      return absl::ResourceExhaustedError(fmt::format(
          "device memory is exhausted: {} gave OpenCL error {}", error.what(), error.err()));
    default:
      return absl::InternalError(
          fmt::format("device failed: {} gave OpenCL error {}", error.what(), error.err()));
  }
}

}  // namespace treelight
