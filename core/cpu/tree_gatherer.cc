#include "core/cpu/tree_gatherer.h"

#include <atomic>
#include <mutex>
#include <span>
#include <string_view>
#include <utility>

#include "core/cpu/batch_gather.h"
#include "core/cpu/clock.h"
#include "core/cpu/simd/packed_search.h"
#include "core/cpu/traverse.h"
#include "core/model/power_moments.h"
#include "tbb/parallel_for.h"

namespace treelight {
namespace {

/// GatherResult::search of a batch.
std::string_view SearchBy(Instructions instructions) {
  switch (instructions) {
    case Instructions::kPlain:
      return "packed tree, plain C++";
    case Instructions::kAvx2:
      return "packed tree, AVX2: nodes of 8 children";
    case Instructions::kAvx512:
      return "packed tree, AVX-512: nodes of 16 children";
  }
  return "";
}

class TreeGatherer : public Gatherer {
 public:
  TreeGatherer(Photons photons, Tree tree, BuildReport report, Instructions instructions)
      : photons_(std::move(photons)),
        tree_(std::move(tree)),
        report_(std::move(report)),
        instructions_(instructions) {
    photons_.positions = {};  // the tree has them
    const auto start = Clock::now();
    search_ = MakePackedSearch(tree_, instructions);
    report_.stages.push_back({"pack", MicrosecondsSince(start)});
    report_.tree = ComputeStatistics(tree_, report_.radius);
    report_.device_bytes = tree_.nodes.size() * (sizeof(Node) + 2 * sizeof(std::uint32_t)) +
                           tree_.photons.size() * sizeof(LeafPhoton) + search_->bytes() +
                           photons_.powers.size() * sizeof(float) +
                           photons_.directions.size() * sizeof(std::int16_t);
  }

  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override {
    if (const auto status = CheckGather(*this, queries, options); !status.ok()) return status;
    const auto start = Clock::now();
    const bool counts_visits = (options.outputs & kOutputStatistics) != 0;
    auto result = !counts_visits
                      ? GatherBatch({*search_, photons_, Bounds(),
                                     options.approximation.weight_tolerance > 0 && has_powers()
                                         ? std::span<const PowerMoments>(Moments())
                                         : std::span<const PowerMoments>()},
                                    queries, options, cancelled)
                      : GatherPlainly(queries, options, cancelled);
    if (!result.ok()) return result;
    result->times.kernel_us = MicrosecondsSince(start);
    result->search = counts_visits ? "binary tree: it counts what it visits, for STATISTICS"
                                   : SearchBy(instructions_);
    return result;
  }

  absl::StatusOr<Tree> ReadTree() const override { return tree_; }
  absl::StatusOr<Photons> ReadPhotons() const override {
    return Photons{.positions = PositionsById(tree_.photons),
                   .powers = photons_.powers,
                   .directions = photons_.directions};
  }
  std::size_t photon_count() const override { return tree_.photons.size(); }
  bool has_powers() const override { return !photons_.powers.empty(); }
  bool has_directions() const override { return !photons_.directions.empty(); }
  const BuildReport& report() const override { return report_; }

 private:
  Box Bounds() const {
    const Root& root = tree_.root;
    return root.count == 0 ? Box{} : MakeBox(root.min, root.max);
  }

  /// Computed by the first gather that adds up whole subtrees.
  const std::vector<PowerMoments>& Moments() const {
    std::call_once(moments_once_, [this] { moments_ = ComputeMoments(tree_, photons_.powers); });
    return moments_;
  }

  /// By the plain search, which counts what it visits.
  absl::StatusOr<GatherResult> GatherPlainly(const GatherQueries& queries,
                                             const GatherOptions& options,
                                             const CancelCheck& cancelled) const {
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

  QueryAnswer Search(const Vec3& center, float radius, const GatherOptions& options) const {
    if (options.approximation.weight_tolerance > 0 && has_powers()) {
      return SumWithin(tree_, center, radius,
                       {Moments(), options.kernel, options.approximation.weight_tolerance});
    }
    if (options.k > 0) return FindNearest(tree_, center, options.k, radius, options.approximation);
    const bool density = has_powers() && (options.outputs & kOutputDensity) != 0;
    return FindWithin(tree_, center, radius,
                      density ? WholeSubtrees::kVisited : WholeSubtrees::kCounted);
  }

  Photons photons_;  ///< without positions
  const Tree tree_;
  BuildReport report_;
  const Instructions instructions_;
  std::unique_ptr<PackedSearch> search_;
  mutable std::once_flag moments_once_;
  mutable std::vector<PowerMoments> moments_;
};

}  // namespace

std::unique_ptr<Gatherer> MakeTreeGatherer(Photons photons, Tree tree, BuildReport report,
                                           Instructions instructions) {
  return std::make_unique<TreeGatherer>(std::move(photons), std::move(tree), std::move(report),
                                        instructions);
}

}  // namespace treelight
