#include "client/render/camera_rays.h"

#include <cmath>
#include <numbers>

#include "client/scenes/vector.h"

namespace treelight::client {

CameraRays::CameraRays(const Camera& camera, int width, int height) : origin_(camera.position) {
  const Vec3 forward = Normalize(camera.target - camera.position);
  const Vec3 right = Normalize(Cross(forward, camera.up));
  const Vec3 down = Cross(forward, right);
  const float half_angle = camera.vertical_fov_degrees / 360 * std::numbers::pi_v<float>;
  const float pixel = 2 * std::tan(half_angle) / static_cast<float>(height);
  right_ = pixel * right;
  down_ = pixel * down;
  corner_ =
      forward - (static_cast<float>(width) / 2) * right_ - (static_cast<float>(height) / 2) * down_;
}

Ray CameraRays::Through(float x, float y) const {
  return {origin_, Normalize(corner_ + x * right_ + y * down_)};
}

std::array<float, 2> JitterInPixel(std::uint32_t sample, std::uint32_t sample_count, float u,
                                   float v) {
  const auto side = static_cast<std::uint32_t>(std::sqrt(static_cast<double>(sample_count)));
  if (sample >= side * side) return {u, v};
  return {(static_cast<float>(sample % side) + u) / static_cast<float>(side),
          (static_cast<float>(sample / side) + v) / static_cast<float>(side)};
}

}  // namespace treelight::client
