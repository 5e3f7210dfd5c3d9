#ifndef TREELIGHT_CLIENT_SCENES_ROOM_H_
#define TREELIGHT_CLIENT_SCENES_ROOM_H_

#include "client/scenes/scene.h"

namespace treelight::client {

/// A conference room full of chairs with bent tubes, shelves with books, and lamps in its ceiling:
/// most triangles are small and crowded. Made after the statistics of the LBL conference room
/// (210,200 triangles). 1 unit = 1 m, y is up.
Scene MakeRoom();

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_ROOM_H_
