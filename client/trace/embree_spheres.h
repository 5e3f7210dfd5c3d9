#ifndef TREELIGHT_CLIENT_TRACE_EMBREE_SPHERES_H_
#define TREELIGHT_CLIENT_TRACE_EMBREE_SPHERES_H_

#include <vector>

#include "client/scenes/scene.h"
#include "embree3/rtcore.h"

namespace treelight::client {

/// Makes `geometry`, of type RTC_GEOMETRY_TYPE_USER, the analytic spheres `spheres`: a primitive
/// each, hit from outside and inside, by single rays and by packets alike. `spheres` must stay
/// where it is as long as `geometry` lives.
void SetSpheres(RTCGeometry geometry, const std::vector<Sphere>& spheres);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_EMBREE_SPHERES_H_
