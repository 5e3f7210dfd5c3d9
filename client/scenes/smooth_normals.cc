#include "client/scenes/smooth_normals.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

namespace treelight::client {
namespace {

constexpr std::uint32_t kNone = ~0u;
// Edges of more triangles than this are creases: no surface is smooth there.
constexpr std::size_t kMaxTrianglesOfSmoothEdge = 8;
// Cosine beyond which a mean and a triangle's own normal are the same for the eye: 0.08 degrees.
constexpr double kFlatCosine = 1 - 1e-6;

struct Vector {
  double x = 0, y = 0, z = 0;
};
Vector operator-(const Vec3& a, const Vec3& b) {
  return {double{a.x} - b.x, double{a.y} - b.y, double{a.z} - b.z};
}
Vector Cross(const Vector& a, const Vector& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double Dot(const Vector& a, const Vector& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
double Length(const Vector& v) { return std::sqrt(Dot(v, v)); }
Vector Scaled(double s, const Vector& v) { return {s * v.x, s * v.y, s * v.z}; }

Vector FaceCross(const Mesh& mesh, std::size_t triangle) {
  const auto& c = mesh.corners[triangle];
  const Vec3& a = mesh.vertices[c[0]];
  return Cross(mesh.vertices[c[1]] - a, mesh.vertices[c[2]] - a);
}

std::uint32_t Bits(float value) { return std::bit_cast<std::uint32_t>(value + 0.0f); }

/// What makes two vertices the same.
using Key = std::array<std::uint32_t, 6>;
Key KeyOf(const Vec3& p, const Vec3& n) {
  return {Bits(p.x), Bits(p.y), Bits(p.z), Bits(n.x), Bits(n.y), Bits(n.z)};
}

std::size_t Hash(const Key& key) {
  std::uint64_t hash = 0;
  for (const std::uint32_t word : key) hash = (hash ^ word) * 0x9e3779b97f4a7c15u + (hash >> 29);
  return hash ^ (hash >> 32);
}

/// Of each of `count` keys the index of the first that equals it.
template <typename KeyAt>
std::vector<std::uint32_t> FirstEqual(std::size_t count, const KeyAt& key_at) {
  std::vector<std::uint32_t> table(std::bit_ceil(2 * count + 1), kNone), first(count);
  const std::size_t mask = table.size() - 1;
  for (std::size_t i = 0; i < count; ++i) {
    const Key key = key_at(i);
    std::size_t slot = Hash(key) & mask;
    while (table[slot] != kNone && key_at(table[slot]) != key) slot = (slot + 1) & mask;
    if (table[slot] == kNone) table[slot] = static_cast<std::uint32_t>(i);
    first[i] = table[slot];
  }
  return first;
}

/// Sets of corners, joined by pairs (Tarjan 1975, with path halving).
class CornerSets {
 public:
  explicit CornerSets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), 0u);
  }
  std::uint32_t Find(std::uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void Join(std::uint32_t a, std::uint32_t b) {
    a = Find(a), b = Find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

/// One side of a triangle, from a lower to a higher vertex or the other way.
struct HalfEdge {
  std::uint64_t vertices = 0;  // the lower one in the high half
  std::uint32_t corner = 0;    // where it begins, 3 * triangle + 0, 1 or 2
  bool rising = false;         // it begins at the lower vertex

  bool operator<(const HalfEdge& e) const {
    return vertices != e.vertices ? vertices < e.vertices : corner < e.corner;
  }
};

std::uint32_t NextCorner(std::uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }

std::vector<HalfEdge> SortedEdges(const Mesh& mesh, const std::vector<std::uint32_t>& places) {
  std::vector<HalfEdge> edges;
  edges.reserve(3 * mesh.corners.size());
  for (std::uint32_t corner = 0; corner < 3 * mesh.corners.size(); ++corner) {
    const auto& c = mesh.corners[corner / 3];
    const std::uint64_t from = places[c[corner % 3]], to = places[c[NextCorner(corner) % 3]];
    edges.push_back({std::min(from, to) << 32 | std::max(from, to), corner, from < to});
  }
  std::sort(edges.begin(), edges.end());
  return edges;
}

/// Joins the corners at both ends of each edge across which the surface is smooth.
CornerSets JoinSmoothCorners(const Mesh& mesh, const std::vector<std::uint32_t>& places,
                             const std::vector<Vector>& normals, double crease_cosine) {
  CornerSets sets(3 * mesh.corners.size());
  const std::vector<HalfEdge> edges = SortedEdges(mesh, places);
  for (std::size_t first = 0, last = 0; first < edges.size(); first = last) {
    while (last < edges.size() && edges[last].vertices == edges[first].vertices) ++last;
    if (last - first > kMaxTrianglesOfSmoothEdge) continue;
    for (std::size_t i = first; i < last; ++i) {
      for (std::size_t j = i + 1; j < last; ++j) {
        const std::uint32_t a = edges[i].corner, b = edges[j].corner;
        if (edges[i].rising == edges[j].rising) continue;
        if (Dot(normals[a / 3], normals[b / 3]) < crease_cosine) continue;
        sets.Join(a, NextCorner(b));
        sets.Join(NextCorner(a), b);
      }
    }
  }
  return sets;
}

double AngleAt(const Mesh& mesh, std::uint32_t corner) {
  const auto& c = mesh.corners[corner / 3];
  const Vec3& p = mesh.vertices[c[corner % 3]];
  const Vector u = mesh.vertices[c[NextCorner(corner) % 3]] - p;
  const Vector v = mesh.vertices[c[NextCorner(NextCorner(corner)) % 3]] - p;
  return std::atan2(Length(Cross(u, v)), Dot(u, v));
}

/// The mean normal of each set of corners, at the index of its first; unit, or 0.
std::vector<Vector> MeanNormals(const Mesh& mesh, const std::vector<Vector>& normals,
                                CornerSets& sets) {
  std::vector<Vector> means(3 * mesh.corners.size());
  for (std::uint32_t corner = 0; corner < means.size(); ++corner) {
    Vector& mean = means[sets.Find(corner)];
    const Vector n = Scaled(AngleAt(mesh, corner), normals[corner / 3]);
    mean = {mean.x + n.x, mean.y + n.y, mean.z + n.z};
  }
  for (Vector& mean : means) {
    const double length = Length(mean);
    mean = length > 1e-9 ? Scaled(1 / length, mean) : Vector{};
  }
  return means;
}

Vec3 ToFloat(const Vector& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

}  // namespace

std::uint64_t RemoveDegenerateTriangles(Mesh& mesh) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < mesh.corners.size(); ++i) {
    // Coordinates are floats, so that the differences are exact but for great differences in scale,
    // and so are the products of triangles on a line that is not oblique.
    if (!(Length(FaceCross(mesh, i)) > 0)) continue;
    mesh.corners[kept] = mesh.corners[i];
    mesh.materials[kept] = mesh.materials[i];
    ++kept;
  }
  const std::uint64_t removed = mesh.corners.size() - kept;
  mesh.corners.resize(kept);
  mesh.materials.resize(kept);
  return removed;
}

void WeldVertices(Mesh& mesh) {
  const std::vector<std::uint32_t> first = FirstEqual(mesh.vertices.size(), [&mesh](std::size_t i) {
    return KeyOf(mesh.vertices[i], mesh.normals.empty() ? Vec3{} : mesh.normals[i]);
  });
  std::vector<std::uint32_t> moved(mesh.vertices.size(), kNone);
  Mesh welded;
  for (auto& triangle : mesh.corners) {
    for (std::uint32_t& corner : triangle) {
      std::uint32_t& to = moved[first[corner]];
      if (to == kNone) {
        to = static_cast<std::uint32_t>(welded.vertices.size());
        welded.vertices.push_back(mesh.vertices[corner]);
        if (!mesh.normals.empty()) welded.normals.push_back(mesh.normals[corner]);
      }
      corner = to;
    }
  }
  mesh.vertices = std::move(welded.vertices);
  mesh.normals = std::move(welded.normals);
}

void AddSmoothNormals(float crease_degrees, Mesh& mesh) {
  const std::vector<std::uint32_t> places = FirstEqual(
      mesh.vertices.size(), [&mesh](std::size_t i) { return KeyOf(mesh.vertices[i], {}); });
  std::vector<Vector> normals(mesh.corners.size());
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const Vector cross = FaceCross(mesh, i);
    normals[i] = Scaled(1 / Length(cross), cross);
  }
  const double crease_cosine = std::cos(double{crease_degrees} * std::numbers::pi / 180);
  CornerSets sets = JoinSmoothCorners(mesh, places, normals, crease_cosine);
  const std::vector<Vector> means = MeanNormals(mesh, normals, sets);

  // A vertex for each corner, then one of those that are equal.
  Mesh split{.vertices = {}, .corners = {}, .materials = std::move(mesh.materials), .normals = {}};
  split.vertices.reserve(3 * mesh.corners.size());
  split.normals.reserve(3 * mesh.corners.size());
  for (std::uint32_t triangle = 0; triangle < mesh.corners.size(); ++triangle) {
    const auto& c = mesh.corners[triangle];
    std::array<Vec3, 3> corner_normals;
    bool flat = true;
    for (std::uint32_t i = 0; i < 3; ++i) {
      const Vec3 given = mesh.normals.empty() ? Vec3{} : mesh.normals[c[i]];
      const Vector& mean = means[sets.Find(3 * triangle + i)];
      const double cosine = Dot(mean, normals[triangle]);
      corner_normals[i] = given != Vec3{} ? given : cosine > 0 ? ToFloat(mean) : Vec3{};
      flat = flat && given == Vec3{} && cosine > kFlatCosine;
    }
    const auto first = static_cast<std::uint32_t>(split.vertices.size());
    split.corners.push_back({first, first + 1, first + 2});
    for (std::uint32_t i = 0; i < 3; ++i) {
      split.vertices.push_back(mesh.vertices[c[i]]);
      split.normals.push_back(flat ? Vec3{} : corner_normals[i]);
    }
  }
  mesh = std::move(split);
  WeldVertices(mesh);
  const bool all_flat = std::all_of(mesh.normals.begin(), mesh.normals.end(),
                                    [](const Vec3& n) { return n == Vec3{}; });
  if (all_flat) mesh.normals.clear();
}

}  // namespace treelight::client
