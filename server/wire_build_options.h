#ifndef TREELIGHT_SERVER_WIRE_BUILD_OPTIONS_H_
#define TREELIGHT_SERVER_WIRE_BUILD_OPTIONS_H_

#include <optional>

#include "absl/status/statusor.h"
#include "core/build_chooser.h"
#include "core/builder.h"
#include "treelight/v1/photon_map.pb.h"

// How a tree is built and what became of it, between the wire (photon_map.proto) and core.
namespace treelight::server {

/// What a build is asked for.
struct AskedBuild {
  BuildOptions options;                ///< of BUILDER_KIND_AUTO those that take the most memory
  std::optional<AutoBuild> automatic;  ///< what BUILDER_KIND_AUTO leaves to be chosen
};

/// The options with defaults for what is 0. INVALID_ARGUMENT names field, value and range.
absl::StatusOr<AskedBuild> ParseBuild(const v1::BuildOptions& wire);

/// AskedBuild::options alone.
absl::StatusOr<BuildOptions> ParseBuildOptions(const v1::BuildOptions& wire);

/// The fields that the builder reads, with the radius that was used.
v1::BuildOptions ToWire(const BuildOptions& options, const BuildReport& report);

/// What the tree that `builder` has made looks like.
v1::TreeStatistics ToWire(const BuildReport& report, BuilderKind builder);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_WIRE_BUILD_OPTIONS_H_
