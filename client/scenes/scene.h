#ifndef TREELIGHT_CLIENT_SCENES_SCENE_H_
#define TREELIGHT_CLIENT_SCENES_SCENE_H_

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "client/scenes/color.h"
#include "core/model/box.h"

namespace treelight::client {

/// How a surface scatters light.
enum class Surface {
  kDiffuse,  ///< Lambertian, both sides alike
  kGlossy,   ///< Lambertian under a normalised Phong lobe (Lafortune and Willems 1994, "Using the
             ///< Modified Phong Reflectance Model"), both sides alike
  kMirror,   ///< ideal reflection, both sides alike
  kDielectric,  ///< smooth boundary to a medium with index `ior`; Fresnel
  kPane,        ///< thin sheet of such a medium: what passes goes straight on
};

/// What a surface is made of.
struct Material {
  std::string name;  ///< for messages
  Surface surface = Surface::kDiffuse;
  Rgb reflectance;     ///< kDiffuse, kGlossy (its Lambertian part), kMirror: [0, 1]; the rest is
                       ///< absorbed
  Rgb specular = {};   ///< kGlossy: reflectance of the lobe; with `reflectance` at most 1
  float exponent = 1;  ///< kGlossy: of the lobe's cosine, >= 0
  float ior = 1;       ///< kDielectric, kPane: index of the inside relative to the
                       ///< outside, > 0
  Rgb transmittance = {1, 1, 1};  ///< kDielectric, kPane: [0, 1], share of the refracted light that
                                  ///< is not absorbed, at each passage of the surface
  Rgb emission = {};  ///< radiance of the front side, W / unit^2 / sr, the same in all directions
};

/// Triangles that share one array of vertices. The front is where the corners run
/// counter-clockwise.
struct Mesh {
  std::vector<Vec3> vertices;                         ///< scene units
  std::vector<std::array<std::uint32_t, 3>> corners;  ///< of each triangle: indices of vertices
  std::vector<std::uint32_t> materials;  ///< of each triangle: index into Scene::materials
  /// Empty, or one unit normal a vertex, interpolated for shading; (0, 0, 0): the triangle's own.
  std::vector<Vec3> normals;
};

/// An analytic sphere, so that caustics are not broken up by facets. The front is the outside.
struct Sphere {
  Vec3 center;
  float radius = 1;            ///< scene units, > 0
  std::uint32_t material = 0;  ///< index into Scene::materials; spheres do not emit
};

/// A light without size: a point that shines in all directions, or a spot that shines in a cone.
struct PointLight {
  Vec3 position;                      ///< scene units
  Rgb intensity;                      ///< in the middle of the cone, W / sr
  Vec3 direction = {0, -1, 0};        ///< axis of the cone, unit
  float cone_degrees = 180;           ///< half the angle of the cone, (0, 180]; 180: all directions
  float falloff_begin_degrees = 180;  ///< where the intensity begins to fall to 0 at the rim,
                                      ///< smoothly; from the axis, [0, cone_degrees]
};

/// Pinhole camera with square pixels.
struct Camera {
  Vec3 position;                    ///< scene units
  Vec3 target;                      ///< the point in the middle of the picture
  Vec3 up = {0, 1, 0};              ///< not parallel to the view
  float vertical_fov_degrees = 40;  ///< angle between lower and upper edge, (0, 180)
};

/// All that is traced: shapes, how they scatter and emit, and where it is seen from. Light comes
/// from triangles whose material emits and from point lights.
struct Scene {
  std::string name;
  std::vector<Material> materials;
  Mesh mesh;
  std::vector<Sphere> spheres;
  std::vector<PointLight> point_lights;
  Camera camera;
};

/// Appends the quadrilateral a, b, c, d, counter-clockwise seen from its front, as two triangles.
void AddQuad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d, std::uint32_t material,
             Mesh& mesh);

/// Makes every surface Lambertian with that reflectance; lights go on shining.
void MakeDiffuse(float reflectance, Scene& scene);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_SCENE_H_
