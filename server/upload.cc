#include "server/upload.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <new>
#include <optional>
#include <span>
#include <string_view>
#include <utility>

#include "core/huge_pages.h"
#include "core/model/first_beyond.h"
#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/refusal.h"

namespace treelight::server {
namespace {

constexpr std::size_t kPositionBytes = 3 * sizeof(float);
constexpr std::size_t kPowerBytes = 3 * sizeof(float);
constexpr std::size_t kDirectionBytes = 2 * sizeof(std::int16_t);

/// Whether `bytes` holds what the header announced for `photon_count` photons.
absl::Status CheckLength(std::string_view field, std::size_t bytes, bool announced,
                         std::size_t bytes_per_photon, std::size_t photon_count) {
  if (!announced && bytes > 0) {
    return absl::InvalidArgumentError(
        fmt::format("chunk.{}: {} bytes, but header.has_{} is false", field, bytes, field));
  }
  if (announced && bytes != bytes_per_photon * photon_count) {
    return absl::InvalidArgumentError(
        fmt::format("chunk.{}: {} bytes, expected {} ({} bytes for each of {} photons)", field,
                    bytes, bytes_per_photon * photon_count, bytes_per_photon, photon_count));
  }
  return absl::OkStatus();
}

/// Appends the numbers that `pieces` hold, whole ones in all, to `array`, and has each block of
/// them checked while the processor's first cache holds it: `check(block)`.
template <typename T, typename Check>
absl::Status Append(const Pieces& pieces, std::vector<T>& array, Check check) {
  constexpr std::size_t kBlockBytes = 12 << 10;  // whole photons
  std::array<T, kBlockBytes / sizeof(T)> block;
  std::size_t filled = 0;  // bytes of `block`
  const auto empty = [&]() -> absl::Status {
    const std::span<const T> numbers(block.data(), std::exchange(filled, 0) / sizeof(T));
    if (auto status = check(numbers); !status.ok()) return status;
    array.insert(array.end(), numbers.begin(), numbers.end());
    return absl::OkStatus();
  };
  for (std::string_view piece : pieces) {
    while (!piece.empty()) {
      const std::size_t size = std::min(piece.size(), kBlockBytes - filled);
      std::memcpy(reinterpret_cast<char*>(block.data()) + filled, piece.data(), size);
      piece.remove_prefix(size);
      filled += size;
      if (filled < kBlockBytes) continue;
      if (auto status = empty(); !status.ok()) return status;
    }
  }
  return empty();
}

/// The same for numbers of which there are three to a photon, finite and within `limit`.
absl::Status AppendNumbers(std::string_view field, const Pieces& pieces, float limit,
                           std::vector<float>& array) {
  return Append(pieces, array, [&](std::span<const float> numbers) -> absl::Status {
    const std::size_t wrong = FirstBeyond(numbers, limit);
    if (wrong == numbers.size()) return absl::OkStatus();
    const std::size_t i = array.size() + wrong;
    return absl::InvalidArgumentError(
        fmt::format("chunk.{}: number {} of photon {} is {}, it must be finite and within {:g}",
                    field, i % 3, i / 3, numbers[wrong], limit));
  });
}

}  // namespace

std::uint64_t DeviceBytes(const BuildPlan& plan) {
  return plan.photon_count * (sizeof(LeafPhoton) + (plan.has_powers ? kPowerBytes : 0) +
                              (plan.has_directions ? kDirectionBytes : 0));
}

absl::Status CheckDeviceRoom(const BuildPlan& plan, const DeviceInfo& device,
                             std::uint64_t bytes_used, std::string_view what,
                             std::chrono::milliseconds retry_delay) {
  const std::uint64_t buffer_bytes = plan.photon_count * sizeof(LeafPhoton);
  if (buffer_bytes > device.max_buffer_bytes) {
    return Refuse(
        Quota::kDevice,
        fmt::format("{}: a buffer of {} bytes, the largest of device '{}' is {}, {} photons; "
                    "build several maps",
                    what, buffer_bytes, device.name, device.max_buffer_bytes,
                    device.max_buffer_bytes / sizeof(LeafPhoton)),
        std::nullopt);
  }
  const std::uint64_t needed = DeviceBytes(plan);
  const std::uint64_t room = device.memory_bytes - std::min(device.memory_bytes, bytes_used);
  if (needed > room) {
    const bool never = needed > device.memory_bytes;
    return Refuse(
        Quota::kDevice,
        fmt::format("{}: at least {} bytes, device '{}' has {} of which maps hold {}; delete maps "
                    "or build a smaller one",
                    what, needed, device.name, device.memory_bytes, bytes_used),
        never ? std::nullopt : std::optional(retry_delay));
  }
  return absl::OkStatus();
}

std::uint64_t PhotonBytes(const BuildPlan& plan) {
  return plan.photon_count * (kPositionBytes + (plan.has_powers ? kPowerBytes : 0) +
                              (plan.has_directions ? kDirectionBytes : 0));
}

std::uint64_t UploadBytes(const BuildPlan& plan, const Limits& limits) {
  return PhotonBytes(plan) + 2 * limits.max_message_bytes;
}

std::uint64_t MapBytes(const BuildPlan& plan) {
  // 64 B a node, of which there are about as many as leaves, that are half full at worst.
  const std::uint64_t tree_bytes = 2 * sizeof(Node) / plan.options.max_leaf_size;
  constexpr std::uint64_t kWorkBytes = 32;
  return plan.photon_count *
         (sizeof(LeafPhoton) + tree_bytes + kWorkBytes + (plan.has_powers ? kPowerBytes : 0) +
          (plan.has_directions ? kDirectionBytes : 0));
}

Upload::Upload(const BuildPlan& plan, const Limits& limits)
    : expected_(plan.photon_count),
      has_powers_(plan.has_powers),
      has_directions_(plan.has_directions),
      max_chunk_bytes_(limits.max_chunk_bytes) {}

absl::StatusOr<Upload> Upload::Start(const BuildPlan& plan, const Limits& limits) {
  Upload upload(plan, limits);
  try {
    ReserveHuge(upload.photons_.positions, 3 * plan.photon_count);
    if (plan.has_powers) ReserveHuge(upload.photons_.powers, 3 * plan.photon_count);
    if (plan.has_directions) ReserveHuge(upload.photons_.directions, 2 * plan.photon_count);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(fmt::format(
        "header.photon_count is {}: the server's memory does not hold so many at present; "
        "build a smaller map or repeat later",
        plan.photon_count));
  }
  return upload;
}

absl::Status Upload::Add(const ChunkArrays& chunk) {
  // Lengths agree with each other and with the header.
  const std::size_t length = Length(chunk.positions), power_bytes = Length(chunk.powers),
                    direction_bytes = Length(chunk.directions);
  const std::size_t photon_count = length / kPositionBytes;
  const std::size_t chunk_bytes = length + power_bytes + direction_bytes;
  if (chunk_bytes > max_chunk_bytes_) {
    return absl::InvalidArgumentError(fmt::format(
        "chunk: arrays of {} bytes, at most {} (ServerLimits.max_chunk_bytes) are possible; "
        "send smaller chunks",
        chunk_bytes, max_chunk_bytes_));
  }
  if (length % kPositionBytes != 0) {
    return absl::InvalidArgumentError(fmt::format(
        "chunk.positions: {} bytes are no multiple of {}, three float32", length, kPositionBytes));
  }
  if (photon_count == 0) {
    return absl::InvalidArgumentError("chunk.positions: 0 photons, a chunk holds at least 1");
  }
  auto status = CheckLength("powers", power_bytes, has_powers_, kPowerBytes, photon_count);
  if (status.ok()) {
    status =
        CheckLength("directions", direction_bytes, has_directions_, kDirectionBytes, photon_count);
  }
  if (!status.ok()) return status;
  if (photon_count > expected_ - received()) {
    return absl::InvalidArgumentError(
        fmt::format("chunk.positions: {} photons after {}, header.photon_count announced {}",
                    photon_count, received(), expected_));
  }

  // Numbers are allowed.
  status = AppendNumbers("positions", chunk.positions, kMaxCoordinate, photons_.positions);
  if (status.ok()) {
    status =
        AppendNumbers("powers", chunk.powers, std::numeric_limits<float>::max(), photons_.powers);
  }
  if (!status.ok()) return status;
  return Append(chunk.directions, photons_.directions, [](auto) { return absl::OkStatus(); });
}

absl::StatusOr<Photons> Upload::Finish() && {
  if (received() != expected_ && !Broken("short_upload")) {
    return absl::InvalidArgumentError(
        fmt::format("the stream ended after {} photons, header.photon_count announced {}",
                    received(), expected_));
  }
  return std::move(photons_);
}

}  // namespace treelight::server
