#ifndef TREELIGHT_CLIENT_TRACE_CHECK_SCENE_H_
#define TREELIGHT_CLIENT_TRACE_CHECK_SCENE_H_

#include "absl/status/status.h"
#include "client/scenes/scene.h"

namespace treelight::client {

/// Whether `scene` can be traced. INVALID_ARGUMENT: a colour, a material that gives more light than
/// it gets, an index of refraction or exponent out of range, an index out of range, normals that
/// are not one a vertex, a radius that is not positive, a sphere that emits, a cone out of range or
/// a direction that is not unit; the message names the material or shape.
absl::Status CheckScene(const Scene& scene);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_CHECK_SCENE_H_
