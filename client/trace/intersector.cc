#include "client/trace/intersector.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <string>
#include <type_traits>
#include <utility>

#include "client/scenes/vector.h"
#include "client/trace/dielectric.h"
#include "embree3/rtcore.h"
#include "fmt/format.h"

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

/// Where the line origin + t * direction enters and leaves `sphere`, in units of the direction's
/// length. In double: the discriminant cancels badly where the ray starts on the sphere or grazes
/// it.
std::optional<std::pair<double, double>> MeetSphere(const Sphere& sphere, const RTCRay& ray) {
  const double ox = double{ray.org_x} - sphere.center.x, oy = double{ray.org_y} - sphere.center.y,
               oz = double{ray.org_z} - sphere.center.z;
  const double dx = ray.dir_x, dy = ray.dir_y, dz = ray.dir_z;
  const double a = dx * dx + dy * dy + dz * dz;
  const double half_b = ox * dx + oy * dy + oz * dz;
  const double c = ox * ox + oy * oy + oz * oz - double{sphere.radius} * sphere.radius;
  const double discriminant = half_b * half_b - a * c;
  if (!(discriminant >= 0) || a == 0) return std::nullopt;
  const double root = std::sqrt(discriminant);
  return std::pair{(-half_b - root) / a, (-half_b + root) / a};
}

/// The nearest place within (tnear, tfar) at which the ray meets the sphere.
std::optional<float> NearestOnSphere(const Sphere& sphere, const RTCRay& ray) {
  const auto places = MeetSphere(sphere, ray);
  if (!places) return std::nullopt;
  for (const double t : {places->first, places->second}) {
    if (t > ray.tnear && t < ray.tfar) return static_cast<float>(t);
  }
  return std::nullopt;
}

const Sphere& SphereOf(const void* user_data, unsigned index) {
  return static_cast<const Scene*>(user_data)->spheres[index];
}

void SphereBounds(const RTCBoundsFunctionArguments* args) {
  const Sphere& s = SphereOf(args->geometryUserPtr, args->primID);
  // One part in a million more, for the rounding of the sum.
  const float r = s.radius * (1 + 1e-6f);
  *args->bounds_o = {s.center.x - r, s.center.y - r, s.center.z - r, 0,
                     s.center.x + r, s.center.y + r, s.center.z + r, 0};
}

// Rays are shot one by one, hence N is 1 in both callbacks.
void SphereIntersect(const RTCIntersectFunctionNArguments* args) {
  if (args->valid[0] == 0) return;
  auto* const rayhit = reinterpret_cast<RTCRayHit*>(args->rayhit);
  const auto t = NearestOnSphere(SphereOf(args->geometryUserPtr, args->primID), rayhit->ray);
  if (!t) return;
  rayhit->ray.tfar = *t;
  rayhit->hit.primID = args->primID;
  rayhit->hit.geomID = args->geomID;
  rayhit->hit.instID[0] = args->context->instID[0];
}

void SphereOccluded(const RTCOccludedFunctionNArguments* args) {
  if (args->valid[0] == 0) return;
  auto* const ray = reinterpret_cast<RTCRay*>(args->ray);
  if (NearestOnSphere(SphereOf(args->geometryUserPtr, args->primID), *ray)) ray->tfar = -INFINITY;
}

absl::Status CheckScene(const Scene& scene) {
  const Mesh& mesh = scene.mesh;
  if (mesh.materials.size() != mesh.corners.size()) {
    return absl::InvalidArgumentError(fmt::format("mesh has {} triangles but {} materials",
                                                  mesh.corners.size(), mesh.materials.size()));
  }
  if (!mesh.normals.empty() && mesh.normals.size() != mesh.vertices.size()) {
    return absl::InvalidArgumentError(fmt::format("mesh has {} vertices but {} normals",
                                                  mesh.vertices.size(), mesh.normals.size()));
  }
  for (std::size_t i = 0; i < mesh.corners.size(); ++i) {
    for (const std::uint32_t corner : mesh.corners[i]) {
      if (corner >= mesh.vertices.size()) {
        return absl::InvalidArgumentError(
            fmt::format("triangle {}: there is no vertex {}", i, corner));
      }
    }
    if (mesh.materials[i] >= scene.materials.size()) {
      return absl::InvalidArgumentError(
          fmt::format("triangle {}: there is no material {}", i, mesh.materials[i]));
    }
  }
  for (std::size_t i = 0; i < scene.spheres.size(); ++i) {
    const Sphere& sphere = scene.spheres[i];
    if (sphere.material >= scene.materials.size()) {
      return absl::InvalidArgumentError(
          fmt::format("sphere {}: there is no material {}", i, sphere.material));
    }
    if (!(sphere.radius > 0)) {
      return absl::InvalidArgumentError(
          fmt::format("sphere {}: radius {} is not positive", i, sphere.radius));
    }
    if (MaxChannel(scene.materials[sphere.material].emission) > 0) {
      return absl::InvalidArgumentError(fmt::format("sphere {} emits; only triangles may", i));
    }
  }
  for (std::size_t i = 0; i < scene.point_lights.size(); ++i) {
    const PointLight& light = scene.point_lights[i];
    if (!(light.cone_degrees > 0 && light.cone_degrees <= 180)) {
      return absl::InvalidArgumentError(
          fmt::format("point light {}: cone_degrees {} is not in (0, 180]", i, light.cone_degrees));
    }
    if (!(light.falloff_begin_degrees >= 0 && light.falloff_begin_degrees <= light.cone_degrees)) {
      return absl::InvalidArgumentError(fmt::format(
          "point light {}: falloff_begin_degrees {} is not between 0 and cone_degrees, {}", i,
          light.falloff_begin_degrees, light.cone_degrees));
    }
    if (!(std::fabs(Dot(light.direction, light.direction) - 1) < 1e-3f)) {
      return absl::InvalidArgumentError(fmt::format(
          "point light {}: the length of its direction is {}, not 1", i, Length(light.direction)));
    }
  }
  return absl::OkStatus();
}

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
    return normal == Vec3{} ? own : normal;
  };
  const Vec3 sum = (1 - u - v) * corner(0) + u * corner(1) + v * corner(2);
  const float squared_length = Dot(sum, sum), cosine = Dot(sum, own);
  if (!(squared_length > 1e-6f) || cosine == 0) return own;
  // Files do not agree on which side of their triangles the normals are.
  return ((cosine < 0 ? -1 : 1) / std::sqrt(squared_length)) * sum;
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
  Scene scene;  // Embree's callbacks point at it: it never moves
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
    rtcSetGeometryUserPrimitiveCount(spheres.get(),
                                     static_cast<unsigned>(impl->scene.spheres.size()));
    rtcSetGeometryUserData(spheres.get(), &impl->scene);
    rtcSetGeometryBoundsFunction(
        spheres.get(), [](const RTCBoundsFunctionArguments* args) { SphereBounds(args); }, nullptr);
    rtcSetGeometryIntersectFunction(spheres.get(), SphereIntersect);
    rtcSetGeometryOccludedFunction(spheres.get(), SphereOccluded);
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
  if (rayhit.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;

  // The position is put back onto the surface: origin + t * direction is less exact.
  Hit hit;
  hit.distance = rayhit.ray.tfar;
  const Scene& scene = impl_->scene;
  if (rayhit.hit.geomID == kMeshId) {
    const auto& [ia, ib, ic] = scene.mesh.corners[rayhit.hit.primID];
    const Vec3& a = scene.mesh.vertices[ia];
    const Vec3 ab = scene.mesh.vertices[ib] - a, ac = scene.mesh.vertices[ic] - a;
    hit.position = KeepInside(a + rayhit.hit.u * ab + rayhit.hit.v * ac, a, ab, ac);
    hit.normal = Normalize(Cross(ab, ac));
    hit.shading_normal =
        InterpolateNormal(scene.mesh, rayhit.hit.primID, rayhit.hit.u, rayhit.hit.v, hit.normal);
    hit.triangle = rayhit.hit.primID;
    hit.material = &scene.materials[scene.mesh.materials[rayhit.hit.primID]];
  } else {
    const Sphere& sphere = scene.spheres[rayhit.hit.primID];
    hit.normal = Normalize(ray.origin + hit.distance * ray.direction - sphere.center);
    hit.shading_normal = hit.normal;
    hit.position = sphere.center + sphere.radius * hit.normal;
    hit.material = &scene.materials[sphere.material];
  }
  hit.front = Dot(ray.direction, hit.normal) < 0;
  if (!hit.front) hit.normal = -hit.normal, hit.shading_normal = -hit.shading_normal;
  return hit;
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
