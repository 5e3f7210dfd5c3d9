#ifndef TREELIGHT_CLIENT_SCENES_CORNELL_H_
#define TREELIGHT_CLIENT_SCENES_CORNELL_H_

#include "client/scenes/scene.h"

namespace treelight::client {

/// The Cornell box (Goral et al. 1984) with a mirror and a glass sphere, as in Jensen 2001,
/// figure 9.1: 2 m wide, open to the camera, one square light in the ceiling. 1 unit = 1 m, y is
/// up.
Scene MakeCornell();

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_CORNELL_H_
