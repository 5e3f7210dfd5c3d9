#include "server/work_estimate.h"

namespace treelight::server {

Work Work::Build(std::uint64_t photon_count, BuilderKind builder) {
  const Kind kind = builder == BuilderKind::kLbvh     ? Kind::kBuildLbvh
                    : builder == BuilderKind::kHybrid ? Kind::kBuildHybrid
                    : ReadsTreelets(builder)          ? Kind::kBuildTreelets
                                                      : Kind::kBuildTopDown;
  return {.kind = kind, .items = photon_count};
}

Work Work::Gather(std::uint32_t k, std::uint64_t query_count) {
  const Kind kind = k == 0     ? Kind::kGatherAll
                    : k <= 8   ? Kind::kGatherCapped8
                    : k <= 128 ? Kind::kGatherCapped128
                               : Kind::kGatherCapped4096;
  return {.kind = kind, .items = query_count};
}

double WorkEstimate::Microseconds(const Work& work) const {
  return us_per_item_[static_cast<std::size_t>(work.kind)] * static_cast<double>(work.items);
}

void WorkEstimate::Measured(const Work& work, double microseconds) {
  constexpr double kNewest = 0.25;
  if (work.items == 0) return;
  double& mean = us_per_item_[static_cast<std::size_t>(work.kind)];
  const double us_per_item = microseconds / static_cast<double>(work.items);
  mean = mean == 0 ? us_per_item : (1 - kNewest) * mean + kNewest * us_per_item;
}

}  // namespace treelight::server
