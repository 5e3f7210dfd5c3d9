#ifndef TREELIGHT_CLIENT_RENDER_DIFFERENCE_H_
#define TREELIGHT_CLIENT_RENDER_DIFFERENCE_H_

#include "absl/status/statusor.h"
#include "client/render/image.h"

namespace treelight::client {

/// Where and by how much two pictures differ.
struct Difference {
  Image signed_difference;  ///< picture - reference in each channel, W / unit^2 / sr
  /// For the eye: white where they are the same, red where the picture is brighter, blue where it
  /// is darker, in the mean of the channels; linear, full at `scale` and beyond. To be encoded as
  /// sRGB.
  Image colors;
  float scale = 0;  ///< W / unit^2 / sr
};

/// The difference of two pictures. `scale` 0: such that 99 of 100 pixels are below it.
/// INVALID_ARGUMENT: the sizes differ.
absl::StatusOr<Difference> ShowDifference(const Image& picture, const Image& reference,
                                          float scale = 0);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_DIFFERENCE_H_
