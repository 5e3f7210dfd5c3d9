#ifndef TREELIGHT_CLIENT_SCENES_BLOB_H_
#define TREELIGHT_CLIENT_SCENES_BLOB_H_

#include "client/scenes/scene.h"

namespace treelight::client {

/// A closed, curved, folded body of 200,000 triangles on a ground, under a lamp. Made after the
/// Stanford dragon (202,520 triangles). 1 unit = 1 m, y is up.
Scene MakeBlob();

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_BLOB_H_
