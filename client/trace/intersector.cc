#include "client/trace/intersector.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>
#include <string>
#include <type_traits>
#include <utility>

#include "client/scenes/vector.h"
#include "client/trace/check_scene.h"
#include "client/trace/dielectric.h"
#include "client/trace/embree_spheres.h"
#include "embree3/rtcore.h"

namespace treelight::client {
namespace {

/// Releases an Embree handle of any kind.
struct Release {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
  void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};
template <typename Handle>
using Owned = std::unique_ptr<std::remove_pointer_t<Handle>, Release>;

// Geometry ids, in the order in which they are attached.
constexpr unsigned kMeshId = 0;
constexpr unsigned kSphereId = 1;

template <typename T>
bool Fill(RTCGeometry geometry, RTCBufferType type, RTCFormat format, const std::vector<T>& data) {
  if (data.empty()) return true;
  // Embree pads the buffer that it makes, so that its last element may be read 16 bytes at a time.
  void* const buffer = rtcSetNewGeometryBuffer(geometry, type, 0, format, sizeof(T), data.size());
  if (buffer != nullptr) std::memcpy(buffer, data.data(), data.size() * sizeof(T));
  return buffer != nullptr;
}

RTCRay MakeRay(const Vec3& origin, const Vec3& direction, float end) {
  RTCRay ray{};
  ray.org_x = origin.x, ray.org_y = origin.y, ray.org_z = origin.z;
  ray.dir_x = direction.x, ray.dir_y = direction.y, ray.dir_z = direction.z;
  ray.tfar = end;
  ray.mask = ~0u;
  return ray;
}

float OffsetComponent(float position, float normal) {
  constexpr float kNearZero = 1.0f / 32, kAbsolute = 1.0f / 65536, kUlps = 256;
  if (std::fabs(position) < kNearZero) return position + kAbsolute * normal;
  const auto ulps = static_cast<std::int32_t>(kUlps * normal);
  return std::bit_cast<float>(std::bit_cast<std::int32_t>(position) +
                              (position < 0 ? -ulps : ulps));
}

/// `position` on the triangle a, a + ab, a + ac, moved towards the middle of the triangle by a few
/// roundings of its coordinates: the position of a hit near an edge may lie behind the neighbouring
/// wall by a rounding, and what leaves from there never comes back.
Vec3 KeepInside(const Vec3& position, const Vec3& a, const Vec3& ab, const Vec3& ac) {
  constexpr float kReach = 4 * 0x1p-23f;
  const Vec3 inward = a + (1.0f / 3) * (ab + ac) - position;
  const float largest =
      std::max({std::fabs(position.x), std::fabs(position.y), std::fabs(position.z), std::fabs(a.x),
                std::fabs(a.y), std::fabs(a.z)});
  const float length = std::sqrt(Dot(inward, inward));
  return length > kReach * largest ? position + (kReach * largest / length) * inward : position;
}

/// The vertex normals of a triangle at the barycentric coordinates (u, v), unit, on the side of its
/// own unit normal; that one where the mesh has none, or where they cancel.
Vec3 InterpolateNormal(const Mesh& mesh, std::uint32_t triangle, float u, float v,
                       const Vec3& own) {
  if (mesh.normals.empty()) return own;
  const auto corner = [&](int i) {
    const Vec3& normal = mesh.normals[mesh.corners[triangle][i]];
    if (normal == Vec3{}) return own;
    // Files do not agree on which side of their triangles the normals are.
    return Dot(normal, own) < 0 ? -normal : normal;
  };
  const Vec3 sum = (1 - u - v) * corner(0) + u * corner(1) + v * corner(2);
  return Dot(sum, own) > 0 ? Normalize(sum) : own;
}

/// What Embree tells about the nearest surface on a ray.
struct RawHit {
  float distance, u, v;
  unsigned geometry, primitive;
};

/// Nothing: the ray met no surface.
std::optional<Hit> Describe(const Scene& scene, const Ray& ray, const RawHit& raw) {
  if (raw.geometry == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
  // The position is put back onto the surface: origin + t * direction is less exact.
  Hit hit;
  hit.distance = raw.distance;
  if (raw.geometry == kMeshId) {
    const auto& [ia, ib, ic] = scene.mesh.corners[raw.primitive];
    const Vec3& a = scene.mesh.vertices[ia];
    const Vec3 ab = scene.mesh.vertices[ib] - a, ac = scene.mesh.vertices[ic] - a;
    hit.position = KeepInside(a + raw.u * ab + raw.v * ac, a, ab, ac);
    hit.normal = Normalize(Cross(ab, ac));
    hit.shading_normal = InterpolateNormal(scene.mesh, raw.primitive, raw.u, raw.v, hit.normal);
    hit.triangle = raw.primitive;
    hit.material = &scene.materials[scene.mesh.materials[raw.primitive]];
  } else {
    const Sphere& sphere = scene.spheres[raw.primitive];
    hit.normal = Normalize(ray.origin + hit.distance * ray.direction - sphere.center);
    hit.shading_normal = hit.normal;
    hit.position = sphere.center + sphere.radius * hit.normal;
    hit.material = &scene.materials[sphere.material];
  }
  hit.front = Dot(ray.direction, hit.normal) < 0;
  if (!hit.front) hit.normal = -hit.normal, hit.shading_normal = -hit.shading_normal;
  return hit;
}

}  // namespace

Vec3 OffsetFromSurface(const Vec3& position, const Vec3& normal) {
  return {OffsetComponent(position.x, normal.x), OffsetComponent(position.y, normal.y),
          OffsetComponent(position.z, normal.z)};
}

Ray LeaveSurface(const Hit& hit, const Vec3& direction) {
  const Vec3 side = Dot(direction, hit.normal) < 0 ? -hit.normal : hit.normal;
  return {OffsetFromSurface(hit.position, side), direction};
}

struct Intersector::Impl {
  Scene scene;  // Embree's callbacks point at its spheres: it never changes
  Owned<RTCDevice> device;
  Owned<RTCScene> rtc_scene;
  bool has_panes = false;
};

absl::StatusOr<Intersector> Intersector::Create(Scene scene) {
  if (const auto status = CheckScene(scene); !status.ok()) return status;
  auto impl = std::make_unique<Impl>();
  impl->scene = std::move(scene);
  impl->has_panes = std::ranges::any_of(impl->scene.materials, [](const Material& material) {
    return material.surface == Surface::kPane;
  });
  std::string error;
  impl->device.reset(rtcNewDevice(nullptr));
  if (!impl->device) return absl::InternalError("Embree: no device");
  RTCDevice device = impl->device.get();
  rtcSetDeviceErrorFunction(
      device,
      [](void* text, RTCError, const char* message) {
        *static_cast<std::string*>(text) = message != nullptr ? message : "unknown error";
      },
      &error);

  const Owned<RTCGeometry> mesh(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  const Owned<RTCGeometry> spheres(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER));
  impl->rtc_scene.reset(rtcNewScene(device));
  if (mesh && spheres && impl->rtc_scene &&
      Fill(mesh.get(), RTC_BUFFER_TYPE_VERTEX, RTC_FORMAT_FLOAT3, impl->scene.mesh.vertices) &&
      Fill(mesh.get(), RTC_BUFFER_TYPE_INDEX, RTC_FORMAT_UINT3, impl->scene.mesh.corners)) {
    rtcCommitGeometry(mesh.get());
    SetSpheres(spheres.get(), impl->scene.spheres);
    rtcCommitGeometry(spheres.get());
    rtcSetSceneFlags(impl->rtc_scene.get(), RTC_SCENE_FLAG_ROBUST);
    rtcSetSceneBuildQuality(impl->rtc_scene.get(), RTC_BUILD_QUALITY_HIGH);
    rtcAttachGeometryByID(impl->rtc_scene.get(), mesh.get(), kMeshId);
    rtcAttachGeometryByID(impl->rtc_scene.get(), spheres.get(), kSphereId);
    rtcCommitScene(impl->rtc_scene.get());
  }
  rtcSetDeviceErrorFunction(device, nullptr, nullptr);
  if (!error.empty()) return absl::InternalError("Embree: " + error);
  return Intersector(std::move(impl));
}

Intersector::Intersector(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Intersector::Intersector(Intersector&&) noexcept = default;
Intersector& Intersector::operator=(Intersector&&) noexcept = default;
Intersector::~Intersector() = default;

const Scene& Intersector::scene() const { return impl_->scene; }

std::optional<Hit> Intersector::Intersect(const Ray& ray) const {
  RTCRayHit rayhit{MakeRay(ray.origin, ray.direction, INFINITY), {}};
  rayhit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rayhit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcIntersect1(impl_->rtc_scene.get(), &context, &rayhit);
  return Describe(impl_->scene, ray,
                  {.distance = rayhit.ray.tfar,
                   .u = rayhit.hit.u,
                   .v = rayhit.hit.v,
                   .geometry = rayhit.hit.geomID,
                   .primitive = rayhit.hit.primID});
}

std::array<std::optional<Hit>, kPacketSize> Intersector::IntersectPacket(
    std::span<const Ray> rays) const {
  assert(rays.size() <= kPacketSize);
  alignas(64) std::array<int, kPacketSize> valid{};  // -1: there is a ray
  RTCRayHit16 packet{};
  RTCRay16& ray = packet.ray;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto& [origin, direction] = rays[i];
    valid[i] = -1;
    ray.org_x[i] = origin.x, ray.org_y[i] = origin.y, ray.org_z[i] = origin.z;
    ray.dir_x[i] = direction.x, ray.dir_y[i] = direction.y, ray.dir_z[i] = direction.z;
    ray.tfar[i] = INFINITY;
    ray.mask[i] = ~0u;
    packet.hit.geomID[i] = packet.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect16(valid.data(), impl_->rtc_scene.get(), &context, &packet);
  std::array<std::optional<Hit>, kPacketSize> hits;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    hits[i] = Describe(impl_->scene, rays[i],
                       {.distance = ray.tfar[i],
                        .u = packet.hit.u[i],
                        .v = packet.hit.v[i],
                        .geometry = packet.hit.geomID[i],
                        .primitive = packet.hit.primID[i]});
  }
  return hits;
}

std::array<Rgb, kPacketSize> Intersector::TransmittancePacket(
    std::span<const Segment> segments) const {
  assert(segments.size() <= kPacketSize);
  alignas(64) std::array<int, kPacketSize> valid{};  // -1: there is a segment
  RTCRay16 ray{};
  for (std::size_t i = 0; i < segments.size(); ++i) {
    const Vec3& origin = segments[i].from;
    const Vec3 path = segments[i].to - origin;
    valid[i] = -1;
    ray.org_x[i] = origin.x, ray.org_y[i] = origin.y, ray.org_z[i] = origin.z;
    ray.dir_x[i] = path.x, ray.dir_y[i] = path.y, ray.dir_z[i] = path.z;
    ray.tfar[i] = 1;
    ray.mask[i] = ~0u;
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded16(valid.data(), impl_->rtc_scene.get(), &context, &ray);
  std::array<Rgb, kPacketSize> passed{};
  for (std::size_t i = 0; i < segments.size(); ++i) {
    if (!(ray.tfar[i] < 0)) {
      passed[i] = {1, 1, 1};
    } else if (impl_->has_panes) {
      passed[i] = Transmittance(segments[i].from, segments[i].to);
    }
  }
  return passed;
}

bool Intersector::Occluded(const Vec3& from, const Vec3& to) const {
  RTCRay ray = MakeRay(from, to - from, 1);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(impl_->rtc_scene.get(), &context, &ray);
  return ray.tfar < 0;
}

Rgb Intersector::Transmittance(const Vec3& from, const Vec3& to) const {
  if (!impl_->has_panes) return Occluded(from, to) ? Rgb{} : Rgb{1, 1, 1};
  Rgb passed{1, 1, 1};
  Ray ray{from, to - from};
  if (!(Dot(ray.direction, ray.direction) > 0)) return passed;
  ray.direction = Normalize(ray.direction);
  while (true) {
    const auto hit = Intersect(ray);
    if (!hit || hit->distance > Dot(to - ray.origin, ray.direction)) return passed;
    if (hit->material->surface != Surface::kPane) return {};
    passed = passed * SplitAtPane(-Dot(ray.direction, hit->normal), hit->material->ior,
                                  hit->material->transmittance)
                          .passed;
    ray = LeaveSurface(*hit, ray.direction);
  }
}

}  // namespace treelight::client
