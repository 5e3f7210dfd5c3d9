#ifndef TREELIGHT_CLIENT_TRACE_INTERSECTOR_H_
#define TREELIGHT_CLIENT_TRACE_INTERSECTOR_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>

#include "absl/status/statusor.h"
#include "client/scenes/scene.h"

namespace treelight::client {

struct Ray {
  Vec3 origin;
  Vec3 direction;  ///< unit
};

/// Where a ray meets a surface.
struct Hit {
  Vec3 position;
  Vec3 normal;          ///< unit, geometric, on the side that the ray comes from
  Vec3 shading_normal;  ///< unit, of the smooth surface that the mesh stands for, on the side of
                        ///< `normal`; the same as `normal` where the mesh has no normals
  float distance = 0;   ///< scene units
  bool front = true;    ///< the ray comes from the front of the surface
  const Material* material = nullptr;       ///< of the Intersector's scene
  std::optional<std::uint32_t> triangle{};  ///< index in Scene::mesh; nothing for a sphere
};

/// `position` moved off its surface to the side of the unit vector `normal`, just beyond the
/// rounding of `position` (Waechter and Binder 2019, "A Fast and Robust Method for Avoiding
/// Self-Intersection").
Vec3 OffsetFromSurface(const Vec3& position, const Vec3& normal);

/// The ray that leaves the surface at `hit` in unit direction `direction`, on whichever side that
/// is.
Ray LeaveSurface(const Hit& hit, const Vec3& direction);

/// What light crosses between two points: move each off its surface.
struct Segment {
  Vec3 from, to;
};

/// Rays that IntersectPacket takes at most, and segments that TransmittancePacket does.
inline constexpr std::size_t kPacketSize = 16;

/// A scene that rays can be shot at, on Embree 3. Immutable; safe to call from several threads at
/// once.
class Intersector {
 public:
  /// Keeps `scene` and builds the acceleration structure. The errors of CheckScene; INTERNAL:
  /// Embree failed; the message is Embree's.
  static absl::StatusOr<Intersector> Create(Scene scene);

  Intersector(Intersector&&) noexcept;
  Intersector& operator=(Intersector&&) noexcept;
  ~Intersector();

  /// The nearest surface that the ray meets, if any.
  std::optional<Hit> Intersect(const Ray& ray) const;

  /// The same for up to kPacketSize rays at once. For rays that are close in origin and direction,
  /// as through neighbouring pixels, this takes a quarter of the time; rays that have scattered are
  /// faster one by one. Where a ray meets two surfaces at one place, or an edge, this and Intersect
  /// need not choose the same.
  std::array<std::optional<Hit>, kPacketSize> IntersectPacket(std::span<const Ray> rays) const;

  /// Whether something stands on the line between two points, ends included: move each off its
  /// surface.
  bool Occluded(const Vec3& from, const Vec3& to) const;

  /// The share of light that gets from one point to the other straight, ends included as for
  /// Occluded: what panes in between let pass; 0 where something else stands there.
  Rgb Transmittance(const Vec3& from, const Vec3& to) const;

  /// The same for up to kPacketSize segments at once; faster for segments that are close to each
  /// other, as from neighbouring points to one light. What only touches the end of a segment may
  /// count for one of this and Transmittance and not for the other.
  std::array<Rgb, kPacketSize> TransmittancePacket(std::span<const Segment> segments) const;

  const Scene& scene() const;

 private:
  struct Impl;
  explicit Intersector(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_INTERSECTOR_H_
