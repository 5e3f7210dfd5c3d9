#ifndef TREELIGHT_CLIENT_SCENES_DEFAULT_VIEW_H_
#define TREELIGHT_CLIENT_SCENES_DEFAULT_VIEW_H_

#include "client/scenes/scene.h"

namespace treelight::client {

/// A camera that sees all of the scene's shapes, from the front, the right and above. The scene
/// must have a shape.
Camera MakeDefaultCamera(const Scene& scene);

/// Whether something in the scene shines: a material that a triangle has, or a point light.
bool HasLight(const Scene& scene);

/// Adds a square light outside of the scene's box, above the camera's left shoulder, that gives
/// its middle an irradiance of about 1.6 W / unit^2.
void AddDefaultLight(Scene& scene);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_DEFAULT_VIEW_H_
