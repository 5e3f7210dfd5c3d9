#ifndef TREELIGHT_CLIENT_SCENES_SHAPES_H_
#define TREELIGHT_CLIENT_SCENES_SHAPES_H_

#include <cstdint>
#include <span>
#include <vector>

#include "client/scenes/scene.h"

namespace treelight::client {

// Shapes of triangles for the scenes that are made by code; each appends to `mesh`, with its front
// outside, and without normals: AddSmoothNormals gives round shapes theirs.

/// A rectangle about `center`, its front where the unit vector `normal` points: `width` along x
/// where it lies flat, else along the horizontal, `height` along the other.
void AddRectangle(const Vec3& center, const Vec3& normal, float width, float height,
                  std::uint32_t material, Mesh& mesh);

/// A box about `center` with edges of `size`, turned by `turn` radians about the vertical.
void AddBox(const Vec3& center, const Vec3& size, float turn, std::uint32_t material, Mesh& mesh);

/// A point of the outline of a solid of revolution.
struct ProfilePoint {
  float radius = 0, height = 0;  ///< from the axis, >= 0, and above `base`, scene units
};

/// The surface of revolution of `profile` about the vertical through `base`, of `segments` parts.
/// The front is to the right of who walks along the profile seen with the axis on the left:
/// outside, where heights rise.
void AddLathe(const Vec3& base, std::span<const ProfilePoint> profile, int segments,
              std::uint32_t material, Mesh& mesh);

/// A tube of `radius` along `path`, of `segments` sides, closed at both ends. Points that follow
/// each other differ, and the path does not turn back.
void AddTube(std::span<const Vec3> path, float radius, int segments, std::uint32_t material,
             Mesh& mesh);

/// `corners` of a path, each rounded by an arc-like curve (quadratic Bezier) that begins and ends
/// `rounding` from it, of `steps` parts.
std::vector<Vec3> RoundedPath(std::span<const Vec3> corners, float rounding, int steps);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_SHAPES_H_
