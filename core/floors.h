#ifndef TREELIGHT_CORE_FLOORS_H_
#define TREELIGHT_CORE_FLOORS_H_

#include <cstddef>
#include <cstdint>
#include <memory>

#include "absl/status/statusor.h"
#include "core/builder.h"

namespace treelight {

/// What no build over as many photons is faster than on a device, microseconds on the clock of its
/// stages.
struct Floors {
  double sort_32_us = 0;         ///< radix sort of pairs of a 30-bit code and a 32-bit id
  double sort_64_us = 0;         ///< of pairs of a 63-bit code and a 32-bit id
  double copy_us = 0;            ///< copy of the photons, 16 bytes each, in the device's memory
  std::uint64_t copy_bytes = 0;  ///< that the copy reads; it writes as many
};

/// Measures floors, with the sort that builds use. Not safe for several threads at once.
class FloorMeter {
 public:
  virtual ~FloorMeter() = default;

  /// Sorts pairs of random codes and copies photons, `count` of each, once; blocks. INTERNAL: the
  /// pairs are not in order. RESOURCE_EXHAUSTED: they do not fit the device.
  virtual absl::StatusOr<Floors> Measure(std::size_t count) = 0;
};

/// On the (first) device that a MakeDeviceBuilder with the same options takes, and its errors.
absl::StatusOr<std::unique_ptr<FloorMeter>> MakeFloorMeter(const DeviceOptions& options = {});

}  // namespace treelight

#endif  // TREELIGHT_CORE_FLOORS_H_
