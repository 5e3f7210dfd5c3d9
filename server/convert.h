#ifndef TREELIGHT_SERVER_CONVERT_H_
#define TREELIGHT_SERVER_CONVERT_H_

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "core/build_chooser.h"
#include "core/builder.h"
#include "core/gatherer.h"
#include "core/merge_choice.h"
#include "server/map_store.h"
#include "server/options.h"
#include "treelight/v1/photon_map.pb.h"

// Between the wire (photon_map.proto) and core. All that comes in is checked here, once;
// INVALID_ARGUMENT names the field, and index and value where there is one, RESOURCE_EXHAUSTED the
// limit, what was asked and what to do.
namespace treelight::server {

/// Longest name of a map, characters; request ids may be as long.
inline constexpr std::size_t kMaxNameLength = 128;

/// Longest time to live of a map.
inline constexpr std::chrono::milliseconds kMaxTimeToLive = std::chrono::hours(24 * 30);

/// Checks that `name` has [1, kMaxNameLength] characters of A-Z a-z 0-9 . _ -; `field` says where
/// it stands.
absl::Status CheckName(std::string_view field, std::string_view name);

/// A v1::BuildHeader that was found good.
struct BuildPlan {
  std::string name;
  std::uint64_t photon_count = 0;  ///< at least 1
  bool has_powers = false;
  bool has_directions = false;
  BuildOptions options;                      ///< of `automatic`, the largest until they are chosen
  std::optional<AutoBuild> automatic{};      ///< what is left to BuildChooser
  std::chrono::milliseconds time_to_live{};  ///< 0: for ever
  std::string request_id;                    ///< or empty
};

absl::StatusOr<BuildPlan> ParseBuildHeader(const v1::BuildHeader& header, const Limits& limits);

/// The plan of another map from the photons of `source`.
absl::StatusOr<BuildPlan> ParseRebuild(const v1::RebuildPhotonMapRequest& request,
                                       const StoredMap& source);

v1::PhotonMap ToWire(const StoredMap& map);
v1::MergeReport ToWire(const MergeChoice& choice);
v1::Device ToWire(const DeviceInfo& device);
v1::ServerLimits ToWire(const Limits& limits);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_CONVERT_H_
