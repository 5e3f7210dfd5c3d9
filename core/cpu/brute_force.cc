#include <algorithm>
#include <utility>
#include <vector>

#include "core/builder.h"
#include "core/cpu/answers.h"
#include "tbb/parallel_for.h"

namespace treelight {
namespace {

/// One query against every photon.
std::vector<Candidate> FindNeighbors(const Photons& photons, const Vec3& center, std::uint32_t k,
                                     float radius) {
  const float squared_radius = radius * radius;
  std::vector<Candidate> found;
  for (std::uint32_t i = 0; i < photons.size(); ++i) {
    const float d2 = SquaredDistance(center, photons.position(i));
    if (d2 <= squared_radius) found.push_back({d2, i});
  }
  if (k > 0 && found.size() > k) {
    std::nth_element(found.begin(), found.begin() + k, found.end());
    found.resize(k);
  }
  std::sort(found.begin(), found.end());
  return found;
}

class BruteForce : public Gatherer {
 public:
  explicit BruteForce(Photons photons) : photons_(std::move(photons)) {
    report_.builder = "brute_force";
    report_.device = "cpu";
  }

  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override {
    if (const auto status = CheckGather(*this, queries, options); !status.ok()) return status;
    std::vector<QueryAnswer> answers(queries.size());
    tbb::parallel_for(std::size_t{0}, queries.size(), [&](std::size_t i) {
      const float* p = &queries.positions[3 * i];
      const float radius = queries.radii.empty() ? options.radius : queries.radii[i];
      answers[i] = {.limit = radius,
                    .found = FindNeighbors(photons_, {p[0], p[1], p[2]}, options.k, radius),
                    .distance_tests = static_cast<std::uint32_t>(photons_.size())};
    });
    if (cancelled && cancelled()) return absl::CancelledError("gather cancelled");
    auto result = WriteAnswers(photons_, queries, options, answers);
    if (result.ok()) result->search = "brute force: every photon for every query";
    return result;
  }

  absl::StatusOr<Tree> ReadTree() const override {
    return absl::UnimplementedError("brute force has no tree");
  }
  absl::StatusOr<Photons> ReadPhotons() const override { return photons_; }
  std::size_t photon_count() const override { return photons_.size(); }
  bool has_powers() const override { return !photons_.powers.empty(); }
  bool has_directions() const override { return !photons_.directions.empty(); }
  const BuildReport& report() const override { return report_; }

 private:
  Photons photons_;
  BuildReport report_;
};

class BruteForceBuilder : public Builder {
 public:
  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck& cancelled) override {
    if (const auto status = CheckBuild(photons, options); !status.ok()) return status;
    if (cancelled && cancelled()) return absl::CancelledError("build cancelled");
    return std::make_unique<BruteForce>(photons);
  }
};

}  // namespace

std::unique_ptr<Builder> MakeBruteForceBuilder() { return std::make_unique<BruteForceBuilder>(); }

}  // namespace treelight
