#ifndef TREELIGHT_CLIENT_SCENES_HALL_H_
#define TREELIGHT_CLIENT_SCENES_HALL_H_

#include "client/scenes/scene.h"

namespace treelight::client {

/// A colonnaded hall of three aisles with arcades, a barrel vault and windows that are its light:
/// large smooth surfaces, many details on few of them. Made after the statistics of the Sibenik
/// cathedral (75,284 triangles), which may not be passed on. 1 unit = 1 m, y is up.
Scene MakeHall();

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_HALL_H_
