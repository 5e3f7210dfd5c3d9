#ifndef TREELIGHT_CLIENT_RENDER_FEATURES_H_
#define TREELIGHT_CLIENT_RENDER_FEATURES_H_

#include <cstdint>

#include "client/render/image.h"
#include "client/trace/intersector.h"

namespace treelight::client {

/// How TraceFeatures samples.
struct FeatureOptions {
  int width = 512, height = 512;        ///< pixels, > 0
  std::uint32_t samples_per_pixel = 4;  ///< > 0
  std::uint64_t seed = 1;
};

/// Albedo and normals of what the camera sees, through mirrors, glass and panes. No light is looked
/// at. The same for any number of threads.
FeatureLayers TraceFeatures(const Intersector& intersector, const FeatureOptions& options);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_FEATURES_H_
