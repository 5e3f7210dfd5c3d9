#ifndef TREELIGHT_CORE_GATHER_COSTS_H_
#define TREELIGHT_CORE_GATHER_COSTS_H_

#include <array>
#include <cstddef>
#include <cstdint>

#include "absl/status/statusor.h"
#include "core/builder.h"
#include "core/gatherer.h"
#include "core/measured_costs.h"

namespace treelight {

/// How a density is gathered, where that makes a difference to its cost.
enum class GatherKind {
  kNearest,  ///< of the k nearest
  kWithin,   ///< within a radius, photon by photon
  kWhole,    ///< within a radius, subtrees that lie within it whole added up by their moments
};

/// The Approximation::weight_tolerance of kWhole: any does where no weight is changed, as of all
/// kernels but the cone.
inline constexpr float kWholeTolerance = 0x1p-20f;

/// What batches of densities cost on a device, microseconds of wall time, by the photons that a
/// query finds.
struct GatherCosts {
  static constexpr std::uint32_t kFewest = 8;  ///< photons of the first entry, doubled by each next
  static constexpr std::size_t kEntries = 8;
  struct Cost {
    double batch_us = 0;  ///< of a batch, however small
    double query_us = 0;  ///< of each query in it
    double Of(double queries) const { return batch_us + queries * query_us; }
  };
  std::array<Cost, kEntries> entries{};

  /// For queries that find so many photons: between two entries by a power of the photons, below
  /// the first as there, beyond the last in proportion to the photons.
  Cost At(double photons) const;
};

/// Measures gathers of one kind on the device of `builder`, of 8 to 1024 photons in a map of
/// 131 072. Takes 0.05 to 0.5 s, and kMeasureBytes at most. The errors of Builder::Build and
/// Gatherer::Gather.
absl::StatusOr<GatherCosts> MeasureGatherCosts(Builder& builder, GatherKind kind,
                                               const CancelCheck& cancelled = {});

/// What gathers cost on a device, measured once for each kind, when it is first asked. Safe to call
/// from several threads at once, which may then measure more than once; others that use the device
/// meanwhile are measured too.
class GatherCostsOfDevice {
 public:
  /// @param builder  outlives this object
  explicit GatherCostsOfDevice(Builder& builder) : builder_(builder) {}

  /// The errors of MeasureGatherCosts.
  absl::StatusOr<GatherCosts> Find(GatherKind kind, const CancelCheck& cancelled = {});

  /// Host memory that Find takes, bytes; 0 once it has measured.
  std::uint64_t WorkBytes(GatherKind kind) const;

 private:
  Builder& builder_;
  MeasuredCosts<GatherKind, GatherCosts> costs_;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_GATHER_COSTS_H_
