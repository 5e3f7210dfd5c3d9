#include "client/trace/embree_spheres.h"

#include <cmath>
#include <limits>
#include <optional>
#include <utility>

namespace treelight::client {
namespace {

/// Where the line through ray `i` of `n` enters and leaves `sphere`, in units of the length of its
/// direction. In double: the discriminant cancels badly where the ray starts on the sphere or
/// grazes it.
std::optional<std::pair<double, double>> MeetSphere(const Sphere& sphere, RTCRayN* rays, unsigned n,
                                                    unsigned i) {
  const double ox = double{RTCRayN_org_x(rays, n, i)} - sphere.center.x,
               oy = double{RTCRayN_org_y(rays, n, i)} - sphere.center.y,
               oz = double{RTCRayN_org_z(rays, n, i)} - sphere.center.z;
  const double dx = RTCRayN_dir_x(rays, n, i), dy = RTCRayN_dir_y(rays, n, i),
               dz = RTCRayN_dir_z(rays, n, i);
  const double a = dx * dx + dy * dy + dz * dz;
  const double half_b = ox * dx + oy * dy + oz * dz;
  const double c = ox * ox + oy * oy + oz * oz - double{sphere.radius} * sphere.radius;
  const double discriminant = half_b * half_b - a * c;
  if (!(discriminant >= 0) || a == 0) return std::nullopt;
  const double root = std::sqrt(discriminant);
  return std::pair{(-half_b - root) / a, (-half_b + root) / a};
}

/// The nearest place within (tnear, tfar) at which the ray meets the sphere.
std::optional<float> NearestOnSphere(const Sphere& sphere, RTCRayN* rays, unsigned n, unsigned i) {
  const auto places = MeetSphere(sphere, rays, n, i);
  if (!places) return std::nullopt;
  for (const double t : {places->first, places->second}) {
    if (t > RTCRayN_tnear(rays, n, i) && t < RTCRayN_tfar(rays, n, i)) return static_cast<float>(t);
  }
  return std::nullopt;
}

const Sphere& SphereOf(const void* user_data, unsigned index) {
  return static_cast<const Sphere*>(user_data)[index];
}

void Bounds(const RTCBoundsFunctionArguments* args) {
  const Sphere& s = SphereOf(args->geometryUserPtr, args->primID);
  // One part in a million more, for the rounding of the sum.
  const float r = s.radius * (1 + 1e-6f);
  *args->bounds_o = {s.center.x - r, s.center.y - r, s.center.z - r, 0,
                     s.center.x + r, s.center.y + r, s.center.z + r, 0};
}

void Intersect(const RTCIntersectFunctionNArguments* args) {
  const unsigned n = args->N;
  RTCRayN* const rays = RTCRayHitN_RayN(args->rayhit, n);
  RTCHitN* const hits = RTCRayHitN_HitN(args->rayhit, n);
  for (unsigned i = 0; i < n; ++i) {
    if (args->valid[i] == 0) continue;
    const auto t = NearestOnSphere(SphereOf(args->geometryUserPtr, args->primID), rays, n, i);
    if (!t) continue;
    RTCRayN_tfar(rays, n, i) = *t;
    RTCHitN_primID(hits, n, i) = args->primID;
    RTCHitN_geomID(hits, n, i) = args->geomID;
    RTCHitN_instID(hits, n, i, 0) = args->context->instID[0];
  }
}

void Occluded(const RTCOccludedFunctionNArguments* args) {
  for (unsigned i = 0; i < args->N; ++i) {
    if (args->valid[i] == 0) continue;
    if (NearestOnSphere(SphereOf(args->geometryUserPtr, args->primID), args->ray, args->N, i))
      RTCRayN_tfar(args->ray, args->N, i) = -std::numeric_limits<float>::infinity();
  }
}

}  // namespace

void SetSpheres(RTCGeometry geometry, const std::vector<Sphere>& spheres) {
  rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(spheres.size()));
  // Embree hands the pointer back and does not write through it.
  rtcSetGeometryUserData(geometry, const_cast<Sphere*>(spheres.data()));
  rtcSetGeometryBoundsFunction(geometry, Bounds, nullptr);
  rtcSetGeometryIntersectFunction(geometry, Intersect);
  rtcSetGeometryOccludedFunction(geometry, Occluded);
}

}  // namespace treelight::client
