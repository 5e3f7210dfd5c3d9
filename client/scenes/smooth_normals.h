#ifndef TREELIGHT_CLIENT_SCENES_SMOOTH_NORMALS_H_
#define TREELIGHT_CLIENT_SCENES_SMOOTH_NORMALS_H_

#include <cstdint>

#include "client/scenes/scene.h"

namespace treelight::client {

/// Takes out the triangles without area, two corners of which are at one place or all on a line.
/// Gives their number.
std::uint64_t RemoveDegenerateTriangles(Mesh& mesh);

/// Makes one of all vertices that have the same position and normal, bit for bit but for the sign
/// of zero, and takes out those that no triangle uses.
void WeldVertices(Mesh& mesh);

/// Gives the corners whose normal is (0, 0, 0), all where mesh.normals is empty, the mean of the
/// normals of the triangles around, each weighted with its angle there (Thuermer and Wuethrich
/// 1998, "Computing Vertex Normals from Polygonal Facets").
///
/// Two triangles are smooth across an edge that they share, by position, in opposite directions, if
/// their normals are at most `crease_degrees` apart; a corner's mean is over the triangles that
/// smooth edges at its vertex connect it with. A vertex with several means becomes several.
/// Triangles that are flat against all of theirs, and corners whose mean is on the triangle's back,
/// keep (0, 0, 0): the triangle's own. No triangle may be degenerate.
void AddSmoothNormals(float crease_degrees, Mesh& mesh);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_SMOOTH_NORMALS_H_
