#ifndef TREELIGHT_CLIENT_SCENES_CAUSTIC_H_
#define TREELIGHT_CLIENT_SCENES_CAUSTIC_H_

#include "client/scenes/scene.h"

namespace treelight::client {

/// A ring of polished metal and a glass sphere on a grey floor, lit by a small lamp and, faintly,
/// by the sky: the ring's caustic has its cusp on the floor inside. The concave wall that faces the
/// lamp, of radius R = 0.6 m, images the lamp, u = 3 m away, at v = 1 / (2 / R - 1 / u) = 1/3 m
/// before it: at z = -0.267. 1 unit = 1 m, y is up.
Scene MakeCaustic();

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_CAUSTIC_H_
