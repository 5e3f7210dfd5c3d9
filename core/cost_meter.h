#ifndef TREELIGHT_CORE_COST_METER_H_
#define TREELIGHT_CORE_COST_METER_H_

#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>

#include "absl/status/status.h"
#include "core/builder.h"
#include "core/gatherer.h"

// What the measurements of a device's costs share.
namespace treelight {

/// Host memory that a measurement takes at most where maps lie in it.
inline constexpr std::uint64_t kMeasureBytes = 64 << 20;

/// Photons of the larger maps that are measured.
inline constexpr std::size_t kMeasuredPhotons = 1 << 17;

/// Times that each thing is measured: the fastest counts, whatever else the machine does only adds
/// time.
inline constexpr int kMeasureRounds = 3;

inline constexpr double kNever = std::numeric_limits<double>::infinity();

/// Points on the faces of the unit cube in random order, the first of them moved to (outlier,
/// outlier, outlier). Leaves of a grid are filled more or less by how many photons a cell has, the
/// same again with four times as many on a surface: the faces' densities, from 1 to 3.2, span that.
Photons FacePhotons(std::size_t count, float outlier = 1);

/// Builds and gathers on one device, their times, and the first error.
class CostMeter {
 public:
  CostMeter(Builder& builder, const CancelCheck& cancelled)
      : builder_(builder), cancelled_(cancelled) {}

  /// Builds a map; null after an error. The wall time in microseconds is the least of what
  /// `fastest_us` was and this one.
  std::unique_ptr<Gatherer> Build(const Photons& photons, const BuildOptions& options,
                                  double& fastest_us);

  /// Gathers; an empty answer after an error.
  GatherResult Gather(const Gatherer& map, std::span<const float> positions,
                      const GatherOptions& options);

  /// The same with its wall time, as Build.
  GatherResult Gather(const Gatherer& map, std::span<const float> positions,
                      const GatherOptions& options, double& fastest_us);

  /// The first of `positions` that take a while together, at least 1024 of them or all.
  std::span<const float> ForAWhile(const Gatherer& map, std::span<const float> positions,
                                   const GatherOptions& options);

  /// The radius that holds `count` photons of `map` at the median of some of `positions`.
  float RadiusOf(const Gatherer& map, std::span<const float> positions, std::uint32_t count);

  const absl::Status& status() const { return status_; }

 private:
  Builder& builder_;
  const CancelCheck& cancelled_;
  absl::Status status_;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_COST_METER_H_
