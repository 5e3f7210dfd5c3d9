#include "client/bench/workloads.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <random>

#include "core/model/morton.h"

namespace treelight {
namespace {

using Random = std::mt19937_64;

struct Sphere {
  Vec3 center;
  float radius;
};

constexpr std::array<Sphere, 3> kSpheres = {
    {{{.3f, .2f, .3f}, .2f}, {{.7f, .15f, .6f}, .15f}, {{.5f, .5f, .5f}, .1f}}};
constexpr std::uint32_t kWalls = 6;  // 2 * axis + side
constexpr std::uint32_t kFloor = 2;  // y = 0
constexpr std::size_t kPatches = 24;
constexpr float kPatchSigma = 0.01f, kPatchShare = 0.3f, kCopyShare = 0.02f;
constexpr float kQuerySpacings = 0.1f;

float Uniform(Random& random) { return std::uniform_real_distribution<float>(0, 1)(random); }
float Gaussian(Random& random, float sigma) {
  return std::normal_distribution<float>(0, sigma)(random);
}

/// A point and the surface that it lies on: a wall, or kWalls + a sphere.
struct SurfacePoint {
  std::array<float, 3> p;
  std::uint32_t surface;
};

SurfacePoint OnWall(std::uint32_t wall, float a, float b) {
  SurfacePoint point{.p = {}, .surface = wall};
  const std::uint32_t axis = wall / 2;
  point.p[axis] = static_cast<float>(wall % 2);
  point.p[(axis + 1) % 3] = std::clamp(a, 0.0f, 1.0f);
  point.p[(axis + 2) % 3] = std::clamp(b, 0.0f, 1.0f);
  return point;
}

/// On a sphere in the direction `d` from its centre.
SurfacePoint OnSphere(std::uint32_t sphere, const std::array<float, 3>& d) {
  const auto& [center, radius] = kSpheres[sphere];
  const float scale = radius / std::hypot(d[0], d[1], d[2]);
  return {{center.x + scale * d[0], center.y + scale * d[1], center.z + scale * d[2]},
          kWalls + sphere};
}

std::array<float, kWalls + 3> SurfaceAreas() {
  std::array<float, kWalls + 3> areas;
  areas.fill(1);
  for (std::size_t i = 0; i < kSpheres.size(); ++i) {
    areas[kWalls + i] = 4 * std::numbers::pi_v<float> * kSpheres[i].radius * kSpheres[i].radius;
  }
  return areas;
}

class Surfaces {
 public:
  explicit Surfaces(Random& random)
      : random_(random), areas_(SurfaceAreas()), choose_(areas_.begin(), areas_.end()) {
    for (std::size_t i = 0; i < kPatches; ++i) {
      const auto wall = i < kPatches / 2 ? kFloor : static_cast<std::uint32_t>(random() % kWalls);
      patches_[i] = {wall, 0.08f + 0.84f * Uniform(random), 0.08f + 0.84f * Uniform(random)};
    }
  }

  SurfacePoint Make() {
    if (Uniform(random_) < kPatchShare) {
      const Patch& patch = patches_[random_() % kPatches];
      return OnWall(patch.wall, patch.a + Gaussian(random_, kPatchSigma),
                    patch.b + Gaussian(random_, kPatchSigma));
    }
    const auto surface = static_cast<std::uint32_t>(choose_(random_));
    if (surface < kWalls) {
      const float a = Uniform(random_);
      return OnWall(surface, a, Uniform(random_));
    }
    return OnSphere(surface - kWalls,
                    {Gaussian(random_, 1), Gaussian(random_, 1), Gaussian(random_, 1)});
  }

  /// Moves a point along its surface.
  SurfacePoint Move(const SurfacePoint& from, float sigma) {
    const std::array<float, 3> by = {Gaussian(random_, sigma), Gaussian(random_, sigma),
                                     Gaussian(random_, sigma)};
    const auto& p = from.p;
    if (from.surface < kWalls) {
      const std::uint32_t axis = from.surface / 2;
      return OnWall(from.surface, p[(axis + 1) % 3] + by[0], p[(axis + 2) % 3] + by[1]);
    }
    const Vec3& c = kSpheres[from.surface - kWalls].center;
    return OnSphere(from.surface - kWalls,
                    {p[0] - c.x + by[0], p[1] - c.y + by[1], p[2] - c.z + by[2]});
  }

  /// The side of the square that each of `count` points has, spread over all surfaces.
  float Spacing(std::size_t count) const {
    const float area = std::accumulate(areas_.begin(), areas_.end(), 0.0f);
    return std::sqrt(area / static_cast<float>(count));
  }

 private:
  struct Patch {
    std::uint32_t wall;
    float a, b;
  };

  Random& random_;
  const std::array<float, kWalls + 3> areas_;
  std::discrete_distribution<int> choose_;
  std::array<Patch, kPatches> patches_;
};

void Append(const std::array<float, 3>& p, std::vector<float>& to) {
  to.insert(to.end(), p.begin(), p.end());
}

Workload MakeUniform(std::size_t count, std::size_t query_count, Random& random) {
  Workload workload;
  workload.positions.resize(3 * count);
  for (float& x : workload.positions) x = Uniform(random);
  const float sigma = kQuerySpacings / std::cbrt(static_cast<float>(count));
  for (std::size_t i = 0; i < query_count; ++i) {
    const float* const p = &workload.positions[3 * (random() % count)];
    for (int axis = 0; axis < 3; ++axis) {
      workload.queries.push_back(p[axis] + Gaussian(random, sigma));
    }
  }
  return workload;
}

Workload MakeSurfaces(std::size_t count, std::size_t query_count, Random& random) {
  Surfaces surfaces(random);
  std::vector<SurfacePoint> points;
  for (std::size_t i = 0; i < count; ++i) {
    const bool copy = i > 0 && Uniform(random) < kCopyShare;
    points.push_back(copy ? points[random() % i] : surfaces.Make());
  }
  const float sigma = kQuerySpacings * surfaces.Spacing(count);
  Workload workload;
  for (const SurfacePoint& point : points) Append(point.p, workload.positions);
  for (std::size_t i = 0; i < query_count; ++i) {
    Append(surfaces.Move(points[random() % count], sigma).p, workload.queries);
  }
  return workload;
}

/// Turns about the diagonal (1, 2, 3) by one radian (Rodrigues).
void Turn(std::vector<float>& positions) {
  const double length = std::sqrt(14.0), k[3] = {1 / length, 2 / length, 3 / length};
  const double c = std::cos(1.0), s = std::sin(1.0);
  for (std::size_t i = 0; i < positions.size(); i += 3) {
    const double p[3] = {positions[i], positions[i + 1], positions[i + 2]};
    const double along = k[0] * p[0] + k[1] * p[1] + k[2] * p[2];
    for (int axis = 0; axis < 3; ++axis) {
      const int y = (axis + 1) % 3, z = (axis + 2) % 3;
      positions[i + axis] = static_cast<float>(p[axis] * c + (k[y] * p[z] - k[z] * p[y]) * s +
                                               k[axis] * along * (1 - c));
    }
  }
}

}  // namespace

std::string NameOf(PointSet set) {
  return set == PointSet::kUniform ? "W1" : set == PointSet::kSurfaces ? "W2" : "W3";
}

Workload MakeWorkload(PointSet set, std::size_t count, std::size_t query_count,
                      std::uint32_t seed) {
  Random random(seed);
  if (set == PointSet::kUniform) return MakeUniform(count, query_count, random);
  Workload workload = MakeSurfaces(count, query_count, random);
  if (set == PointSet::kTurned) {
    Turn(workload.positions);
    Turn(workload.queries);
  }
  return workload;
}

std::vector<float> InMortonOrder(const std::vector<float>& points) {
  constexpr unsigned kBits = 21;
  Box box;
  for (std::size_t i = 0; i < points.size(); i += 3) {
    box.Extend(Vec3{points[i], points[i + 1], points[i + 2]});
  }
  const MortonGrid grid = MakeMortonGrid(box, kBits);
  std::vector<std::pair<std::uint64_t, std::size_t>> order;
  for (std::size_t i = 0; i < points.size(); i += 3) {
    order.emplace_back(MortonCode({points[i], points[i + 1], points[i + 2]}, grid, kBits), i);
  }
  std::sort(order.begin(), order.end());
  std::vector<float> sorted;
  for (const auto& [code, place] : order) {
    sorted.insert(sorted.end(), points.begin() + static_cast<std::ptrdiff_t>(place),
                  points.begin() + static_cast<std::ptrdiff_t>(place) + 3);
  }
  return sorted;
}

}  // namespace treelight
