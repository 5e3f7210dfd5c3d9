#ifndef TREELIGHT_CLIENT_RENDER_CAMERA_RAYS_H_
#define TREELIGHT_CLIENT_RENDER_CAMERA_RAYS_H_

#include <array>
#include <cstdint>

#include "client/scenes/scene.h"
#include "client/trace/intersector.h"

namespace treelight::client {

/// The rays of a pinhole camera through the pixels of a picture.
class CameraRays {
 public:
  /// Of a picture of `width` x `height` pixels, > 0.
  CameraRays(const Camera& camera, int width, int height);

  /// The ray through (x, y), in pixels from the upper left corner of the picture.
  Ray Through(float x, float y) const;

 private:
  Vec3 origin_, corner_, right_, down_;  // corner_: from the pinhole; right_, down_: one pixel
};

/// Place of sample `sample` of `sample_count` within its pixel, in [0, 1)^2, jittered by (u, v) in
/// [0, 1)^2: one sample in each cell of the largest square grid that the count fills, the rest
/// anywhere.
std::array<float, 2> JitterInPixel(std::uint32_t sample, std::uint32_t sample_count, float u,
                                   float v);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_CAMERA_RAYS_H_
