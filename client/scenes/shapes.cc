#include "client/scenes/shapes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "client/scenes/vector.h"

namespace treelight::client {
namespace {

/// Point `i` of `count` on the unit circle; the same bits for i = 0 and i = count.
std::pair<float, float> OnCircle(int i, int count) {
  const double angle = 2 * std::numbers::pi * (i % count) / count;
  return {static_cast<float>(std::cos(angle)), static_cast<float>(std::sin(angle))};
}

/// Joins `row_count` rows of `row_size` vertices, which begin at `first` and are closed rings, by
/// triangles.
void JoinRings(std::uint32_t first, int row_count, int row_size, std::uint32_t material,
               Mesh& mesh) {
  const auto at = [&](int row, int i) {
    return first + static_cast<std::uint32_t>(row * row_size + i % row_size);
  };
  for (int row = 0; row + 1 < row_count; ++row) {
    for (int i = 0; i < row_size; ++i) {
      mesh.corners.push_back({at(row, i), at(row + 1, i), at(row + 1, i + 1)});
      mesh.corners.push_back({at(row, i), at(row + 1, i + 1), at(row, i + 1)});
    }
  }
  mesh.materials.resize(mesh.corners.size(), material);
}

}  // namespace

void AddRectangle(const Vec3& center, const Vec3& normal, float width, float height,
                  std::uint32_t material, Mesh& mesh) {
  const bool flat = std::fabs(normal.y) > 0.9999f;
  const Vec3 u = flat ? Vec3{1, 0, 0} : Normalize(Cross({0, 1, 0}, normal));
  const Vec3 a = (width / 2) * u, b = (height / 2) * Cross(normal, u);
  AddQuad(center - a - b, center + a - b, center + a + b, center - a + b, material, mesh);
}

void AddBox(const Vec3& center, const Vec3& size, float turn, std::uint32_t material, Mesh& mesh) {
  const float c = std::cos(turn), s = std::sin(turn);
  const Vec3 x = {c, 0, -s}, y = {0, 1, 0}, z = {s, 0, c};
  const auto face = [&](const Vec3& n, float depth, const Vec3& u, float width, const Vec3& v,
                        float height) {
    const Vec3 middle = center + (depth / 2) * n, a = (width / 2) * u, b = (height / 2) * v;
    AddQuad(middle - a - b, middle + a - b, middle + a + b, middle - a + b, material, mesh);
  };
  face(x, size.x, y, size.y, z, size.z);
  face(-x, size.x, z, size.z, y, size.y);
  face(y, size.y, z, size.z, x, size.x);
  face(-y, size.y, x, size.x, z, size.z);
  face(z, size.z, x, size.x, y, size.y);
  face(-z, size.z, y, size.y, x, size.x);
}

void AddLathe(const Vec3& base, std::span<const ProfilePoint> profile, int segments,
              std::uint32_t material, Mesh& mesh) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const ProfilePoint& point : profile) {
    for (int i = 0; i < segments; ++i) {
      const auto [c, s] = OnCircle(i, segments);
      mesh.vertices.push_back(base + Vec3{point.radius * c, point.height, point.radius * s});
    }
  }
  JoinRings(first, static_cast<int>(profile.size()), segments, material, mesh);
}

void AddTube(std::span<const Vec3> path, float radius, int segments, std::uint32_t material,
             Mesh& mesh) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  const std::size_t count = path.size();
  Vec3 side{};  // carried along, so that the tube does not twist
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3 along = Normalize(path[std::min(i + 1, count - 1)] - path[i == 0 ? 0 : i - 1]);
    if (i == 0) side = std::fabs(along.y) < 0.9f ? Vec3{0, 1, 0} : Vec3{1, 0, 0};
    side = Normalize(side - Dot(side, along) * along);
    const Vec3 other = Cross(side, along);
    for (int k = 0; k < segments; ++k) {
      const auto [c, s] = OnCircle(k, segments);
      mesh.vertices.push_back(path[i] + radius * (c * side + s * other));
    }
  }
  JoinRings(first, static_cast<int>(count), segments, material, mesh);
  // Both ends are fans.
  const auto ring = [&](std::size_t row, int k) {
    return first + static_cast<std::uint32_t>(row * segments + k % segments);
  };
  for (int k = 1; k + 1 < segments; ++k) {
    mesh.corners.push_back({ring(0, 0), ring(0, k), ring(0, k + 1)});
    mesh.corners.push_back({ring(count - 1, 0), ring(count - 1, k + 1), ring(count - 1, k)});
  }
  mesh.materials.resize(mesh.corners.size(), material);
}

std::vector<Vec3> RoundedPath(std::span<const Vec3> corners, float rounding, int steps) {
  std::vector<Vec3> path = {corners.front()};
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
    const Vec3& corner = corners[i];
    const Vec3 from = corner + rounding * Normalize(corners[i - 1] - corner);
    const Vec3 to = corner + rounding * Normalize(corners[i + 1] - corner);
    for (int k = 0; k <= steps; ++k) {
      const float t = static_cast<float>(k) / static_cast<float>(steps), u = 1 - t;
      path.push_back(u * u * from + 2 * t * u * corner + t * t * to);
    }
  }
  path.push_back(corners.back());
  return path;
}

}  // namespace treelight::client
