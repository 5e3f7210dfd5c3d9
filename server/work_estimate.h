#ifndef TREELIGHT_SERVER_WORK_ESTIMATE_H_
#define TREELIGHT_SERVER_WORK_ESTIMATE_H_

#include <array>
#include <cstddef>
#include <cstdint>

#include "core/builder.h"

namespace treelight::server {

/// What a job asks of the device.
struct Work {
  /// Jobs of one kind take about the same time for each item.
  enum class Kind {
    kOther,
    kBuildLbvh,
    kBuildTreelets,
    kBuildHybrid,
    kBuildTopDown,
    kGatherCapped8,
    kGatherCapped128,
    kGatherCapped4096,
    kGatherAll
  };
  static constexpr std::size_t kKindCount = 9;

  static Work Build(std::uint64_t photon_count, BuilderKind builder = BuilderKind::kLbvh);
  static Work Gather(std::uint32_t k, std::uint64_t query_count);

  bool is_gather() const { return kind >= Kind::kGatherCapped8; }

  Kind kind = Kind::kOther;
  std::uint64_t items = 0;  ///< photons of a build, queries of a gather
};

/// How long jobs take, judged by those before: for each kind a mean of the time per item in which
/// the last job counts for a quarter. Not thread-safe.
class WorkEstimate {
 public:
  /// 0 where no job of the kind has run yet: what is not known is no reason to refuse.
  double Microseconds(const Work& work) const;

  /// Takes note of a job that has run.
  void Measured(const Work& work, double microseconds);

 private:
  std::array<double, Work::kKindCount> us_per_item_{};  // 0: not measured
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_WORK_ESTIMATE_H_
