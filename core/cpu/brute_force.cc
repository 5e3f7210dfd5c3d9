#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "core/builder.h"
#include "core/model/octahedral.h"
#include "tbb/parallel_for.h"

namespace treelight {
namespace {

struct Candidate {
  float squared_distance;
  std::uint32_t id;
  friend auto operator<=>(const Candidate&, const Candidate&) = default;
};

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

double KernelWeight(DensityKernel kernel, double squared_distance, double radius) {
  const double t2 = squared_distance / (radius * radius);
  switch (kernel) {
    case DensityKernel::kConstant:
      return 1;
    case DensityKernel::kCone:
      return 3 * (1 - std::sqrt(t2));
    case DensityKernel::kEpanechnikov:
      return 2 * (1 - t2);
  }
  return 0;
}

/// Density in double, so that the devices' float sums can be judged by it.
void AddDensity(const Photons& photons, const std::vector<Candidate>& found, const float* normal,
                DensityKernel kernel, float radius, float* density) {
  double sum[3] = {0, 0, 0};
  if (!(radius > 0) || std::isinf(radius)) return;
  for (const auto& [d2, id] : found) {
    if (normal != nullptr) {
      const Vec3 d = DecodeOctahedral(photons.directions[2 * id], photons.directions[2 * id + 1]);
      if (d.x * normal[0] + d.y * normal[1] + d.z * normal[2] >= 0) continue;
    }
    const double weight = std::max(0.0, KernelWeight(kernel, d2, radius));
    for (int c = 0; c < 3; ++c) sum[c] += weight * photons.powers[3 * id + c];
  }
  const double area = std::numbers::pi * radius * radius;
  for (int c = 0; c < 3; ++c) density[c] = static_cast<float>(sum[c] / area);
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
    const std::size_t m = queries.size();
    std::vector<std::vector<Candidate>> lists(m);
    std::vector<float> limits(m);
    tbb::parallel_for(std::size_t{0}, m, [&](std::size_t i) {
      const float* p = &queries.positions[3 * i];
      limits[i] = queries.radii.empty() ? options.radius : queries.radii[i];
      lists[i] = FindNeighbors(photons_, {p[0], p[1], p[2]}, options.k, limits[i]);
    });
    if (cancelled && cancelled()) return absl::CancelledError("gather cancelled");
    if (options.k == 0 && (options.outputs & kOutputNeighbors) != 0) {
      std::uint64_t neighbor_count = 0;
      for (const auto& list : lists) neighbor_count += list.size();
      if (const auto status = CheckNeighborCount(neighbor_count, options); !status.ok()) {
        return status;
      }
    }
    return Write(queries, options, lists, limits);
  }

  absl::StatusOr<Tree> ReadTree() const override {
    return absl::UnimplementedError("brute force has no tree");
  }
  std::size_t photon_count() const override { return photons_.size(); }
  bool has_powers() const override { return !photons_.powers.empty(); }
  bool has_directions() const override { return !photons_.directions.empty(); }
  const BuildReport& report() const override { return report_; }

 private:
  GatherResult Write(const GatherQueries& queries, const GatherOptions& options,
                     const std::vector<std::vector<Candidate>>& lists,
                     const std::vector<float>& limits) const {
    const std::size_t m = lists.size();
    const auto wants = [&](std::uint32_t output) { return (options.outputs & output) != 0; };
    GatherResult result;
    if (wants(kOutputDensity)) result.densities.assign(3 * m, 0);
    if (wants(kOutputNeighbors) && options.k == 0) result.neighbor_offsets.push_back(0);
    for (std::size_t i = 0; i < m; ++i) {
      const auto& list = lists[i];
      const float radius = options.k > 0 && list.size() == options.k
                               ? std::sqrt(list.back().squared_distance)
                               : limits[i];
      if (wants(kOutputCount)) result.counts.push_back(static_cast<std::uint32_t>(list.size()));
      if (wants(kOutputRadius)) result.radii.push_back(radius);
      if (wants(kOutputNeighbors)) {
        for (const auto& [d2, id] : list) {
          result.neighbor_ids.push_back(id);
          result.neighbor_squared_distances.push_back(d2);
        }
        if (options.k == 0) {
          result.neighbor_offsets.push_back(result.neighbor_ids.size());
        } else {
          result.neighbor_ids.resize((i + 1) * options.k, kNoPhoton);
          result.neighbor_squared_distances.resize((i + 1) * options.k, INFINITY);
        }
      }
      if (wants(kOutputDensity) && has_powers()) {
        AddDensity(photons_, list, queries.normals.empty() ? nullptr : &queries.normals[3 * i],
                   options.kernel, radius, &result.densities[3 * i]);
      }
      if (wants(kOutputStatistics)) {
        result.nodes_visited.push_back(0);
        result.distance_tests.push_back(static_cast<std::uint32_t>(photons_.size()));
      }
    }
    return result;
  }

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
