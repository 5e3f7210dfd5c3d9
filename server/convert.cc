#include "server/convert.h"

#include <utility>

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/wire_build_options.h"

namespace treelight::server {
namespace {

/// Whether `c` may stand in a name: ASCII only, whatever the locale.
bool IsNameCharacter(char c) {
  return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '.' ||
         c == '_' || c == '-';
}

absl::StatusOr<std::chrono::milliseconds> ParseTimeToLive(std::string_view field,
                                                          std::uint64_t milliseconds) {
  if (milliseconds <= static_cast<std::uint64_t>(kMaxTimeToLive.count()))
    return std::chrono::milliseconds(milliseconds);
  return absl::InvalidArgumentError(fmt::format("{} is {}, at most {} (30 days) is possible", field,
                                                milliseconds, kMaxTimeToLive.count()));
}

std::int64_t UnixMs(TimePoint time) {
  return std::chrono::duration_cast<std::chrono::milliseconds>(time.time_since_epoch()).count();
}

}  // namespace

absl::Status CheckName(std::string_view field, std::string_view name) {
  if (name.empty() || name.size() > kMaxNameLength) {
    return absl::InvalidArgumentError(
        fmt::format("{}: {} characters, it must have [1, {}]", field, name.size(), kMaxNameLength));
  }
  for (std::size_t i = 0; i < name.size(); ++i) {
    if (!IsNameCharacter(name[i])) {
      return absl::InvalidArgumentError(
          fmt::format("{}[{}] is the byte 0x{:02x}, allowed are A-Z a-z 0-9 . _ -", field, i,
                      static_cast<unsigned char>(name[i])));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<BuildPlan> ParseBuildHeader(const v1::BuildHeader& header, const Limits& limits) {
  if (auto status = CheckName("header.name", header.name()); !status.ok()) return status;
  if (!header.request_id().empty()) {
    const auto status = CheckName("header.request_id", header.request_id());
    if (!status.ok()) return status;
  }
  if (header.photon_count() == 0) {
    return absl::InvalidArgumentError("header.photon_count is 0, a map needs at least 1 photon");
  }
  if (header.photon_count() > limits.max_photons && !Broken("limits")) {
    return absl::ResourceExhaustedError(
        fmt::format("header.photon_count is {}, the limit of a map is {} (--max-photons); "
                    "build several maps or raise the limit",
                    header.photon_count(), limits.max_photons));
  }
  const auto time_to_live = ParseTimeToLive("header.time_to_live_ms", header.time_to_live_ms());
  if (!time_to_live.ok()) return time_to_live.status();
  const auto build = ParseBuild(header.options());
  if (!build.ok()) return build.status();
  return BuildPlan{.name = header.name(),
                   .photon_count = header.photon_count(),
                   .has_powers = header.has_powers(),
                   .has_directions = header.has_directions(),
                   .options = build->options,
                   .automatic = build->automatic,
                   .time_to_live = *time_to_live,
                   .request_id = header.request_id()};
}

absl::StatusOr<BuildPlan> ParseRebuild(const v1::RebuildPhotonMapRequest& request,
                                       const StoredMap& source) {
  for (const auto& [field, name] : {std::pair{"new_name", &request.new_name()},
                                    std::pair{"request_id", &request.request_id()}}) {
    if (name->empty()) continue;
    if (auto status = CheckName(field, *name); !status.ok()) return status;
  }
  const auto time_to_live = ParseTimeToLive("time_to_live_ms", request.time_to_live_ms());
  if (!time_to_live.ok()) return time_to_live.status();
  const auto build = ParseBuild(request.options());
  if (!build.ok()) return build.status();
  return BuildPlan{.name = request.new_name().empty() ? source.name : request.new_name(),
                   .photon_count = source.gatherer->photon_count(),
                   .has_powers = source.gatherer->has_powers(),
                   .has_directions = source.gatherer->has_directions(),
                   .options = build->options,
                   .automatic = build->automatic,
                   .time_to_live = *time_to_live,
                   .request_id = request.request_id()};
}

v1::PhotonMap ToWire(const StoredMap& map) {
  const BuildReport& report = map.gatherer->report();
  v1::PhotonMap wire;
  wire.set_name(map.name);
  wire.set_version(map.version);
  wire.set_photon_count(map.gatherer->photon_count());
  wire.set_has_powers(map.gatherer->has_powers());
  wire.set_has_directions(map.gatherer->has_directions());
  *wire.mutable_options() = ToWire(map.options, report);
  *wire.mutable_statistics() = ToWire(report, map.options.builder);
  wire.set_builder(report.builder);
  wire.set_choice(map.choice);
  for (const StageTime& stage : report.stages) {
    v1::StageTime& time = *wire.add_build_stages();
    time.set_stage(stage.stage);
    time.set_microseconds(stage.microseconds);
  }
  wire.set_device_bytes(DeviceBytes(map));
  wire.set_device(report.device);
  wire.set_created_unix_ms(UnixMs(map.created));
  if (map.expires) wire.set_expires_unix_ms(UnixMs(*map.expires));
  return wire;
}

v1::MergeReport ToWire(const MergeChoice& choice) {
  const auto reason = [&] {
    switch (choice.reason) {
      case ExactReason::kNone:
        return v1::EXACT_REASON_UNSPECIFIED;
      case ExactReason::kFewQueries:
        return v1::EXACT_REASON_FEW_QUERIES;
      case ExactReason::kFewPhotons:
        return v1::EXACT_REASON_FEW_PHOTONS;
      case ExactReason::kErrorTooBig:
        return v1::EXACT_REASON_ERROR_TOO_BIG;
      case ExactReason::kNoMemory:
        return v1::EXACT_REASON_NO_MEMORY;
    }
    return v1::EXACT_REASON_UNSPECIFIED;
  };
  v1::MergeReport wire;
  if (choice.fewer.kind == FewerPhotons::Kind::kMerged) {
    wire.set_merged_photons(choice.fewer.group_size);
  } else {
    wire.set_thinned_photons(choice.fewer.group_size);
  }
  wire.set_exact_reason(reason());
  wire.set_sampled_queries(choice.sampled);
  wire.set_measured_error(choice.measured_error);
  wire.set_error_limit(choice.error_limit);
  wire.set_whole_subtrees(choice.whole);
  return wire;
}

v1::Device ToWire(const DeviceInfo& device) {
  v1::Device wire;
  wire.set_index(device.index);
  wire.set_name(device.name);
  wire.set_platform(device.platform);
  wire.set_driver(device.driver);
  wire.set_type(device.type);
  wire.set_compute_units(device.compute_units);
  wire.set_memory_bytes(device.memory_bytes);
  wire.set_max_buffer_bytes(device.max_buffer_bytes);
  return wire;
}

v1::ServerLimits ToWire(const Limits& limits) {
  v1::ServerLimits wire;
  wire.set_max_message_bytes(limits.max_message_bytes);
  wire.set_max_chunk_bytes(limits.max_chunk_bytes);
  wire.set_max_photons(limits.max_photons);
  wire.set_max_queries(limits.max_queries);
  wire.set_max_k(kMaxNeighbors);
  wire.set_max_leaf_size(kMaxLeafSize);
  wire.set_max_neighbors(limits.max_neighbors);
  return wire;
}

}  // namespace treelight::server
