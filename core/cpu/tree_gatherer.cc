#include "core/cpu/tree_gatherer.h"

#include <atomic>
#include <utility>

#include "core/cpu/traverse.h"
#include "tbb/parallel_for.h"

namespace treelight {
namespace {

class TreeGatherer : public Gatherer {
 public:
  TreeGatherer(Photons photons, Tree tree, BuildReport report)
      : photons_(std::move(photons)), tree_(std::move(tree)), report_(std::move(report)) {
    report_.tree = ComputeStatistics(tree_, report_.radius);
  }

  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override {
    if (const auto status = CheckGather(*this, queries, options); !status.ok()) return status;
    std::vector<QueryAnswer> answers(queries.size());
    std::atomic<bool> stop = cancelled && cancelled();
    tbb::parallel_for(std::size_t{0}, queries.size(), [&](std::size_t i) {
      if (stop || (cancelled && i % 1024 == 0 && cancelled())) {
        stop = true;
        return;
      }
      const float* p = &queries.positions[3 * i];
      const float radius = queries.radii.empty() ? options.radius : queries.radii[i];
      answers[i] = Search({p[0], p[1], p[2]}, radius, options);
    });
    if (stop) return absl::CancelledError("gather cancelled");
    return WriteAnswers(photons_, queries, options, answers);
  }

  absl::StatusOr<Tree> ReadTree() const override { return tree_; }
  absl::StatusOr<Photons> ReadPhotons() const override { return photons_; }
  std::size_t photon_count() const override { return photons_.size(); }
  bool has_powers() const override { return !photons_.powers.empty(); }
  bool has_directions() const override { return !photons_.directions.empty(); }
  const BuildReport& report() const override { return report_; }

 private:
  QueryAnswer Search(const Vec3& center, float radius, const GatherOptions& options) const {
    if (options.k > 0) return FindNearest(tree_, center, options.k, radius);
    const bool density = has_powers() && (options.outputs & kOutputDensity) != 0;
    return FindWithin(tree_, center, radius,
                      density ? WholeSubtrees::kVisited : WholeSubtrees::kCounted);
  }

  const Photons photons_;
  const Tree tree_;
  BuildReport report_;
};

}  // namespace

std::unique_ptr<Gatherer> MakeTreeGatherer(Photons photons, Tree tree, BuildReport report) {
  return std::make_unique<TreeGatherer>(std::move(photons), std::move(tree), std::move(report));
}

}  // namespace treelight
