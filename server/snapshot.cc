#include "server/snapshot.h"

#include <xxhash.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <new>
#include <vector>

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/convert.h"
#include "server/wire_build_options.h"

namespace treelight::server {
namespace {

static_assert(std::endian::native == std::endian::little);

constexpr std::string_view kMagic{"TLMAP\r\n\x1a", 8};
constexpr std::uint32_t kMaxDescriptionBytes = 1 << 20, kMaxRequestBytes = 4096;
constexpr std::uint64_t kBlockBytes = 1 << 20;

/// The first bytes of a file.
struct Prefix {
  std::array<char, 8> magic{};
  std::uint32_t version = 0, description_bytes = 0, request_id_bytes = 0, request_bytes = 0;
  std::uint64_t checksum = 0;
};
static_assert(sizeof(Prefix) == 32);
constexpr std::size_t kSummedPrefix = 24;

std::string_view View(const Prefix& prefix) {
  return {reinterpret_cast<const char*>(&prefix), sizeof(prefix)};
}

std::uint64_t Sum(const Prefix& prefix, std::string_view texts) {
  std::string bytes(View(prefix).substr(0, kSummedPrefix));
  bytes.append(texts);
  return XXH3_64bits(bytes.data(), bytes.size());
}

std::uint64_t BlockCount(std::uint64_t array_bytes) {
  return (array_bytes + kBlockBytes - 1) / kBlockBytes;
}

/// Bytes of each of the three arrays, 0 where it is absent.
std::array<std::uint64_t, 3> ArrayBytes(std::uint64_t photon_count, bool has_powers,
                                        bool has_directions) {
  return {photon_count * 3 * sizeof(float), has_powers ? photon_count * 3 * sizeof(float) : 0,
          has_directions ? photon_count * 2 * sizeof(std::int16_t) : 0};
}

std::uint64_t BodyBytes(const std::array<std::uint64_t, 3>& arrays) {
  std::uint64_t bytes = 0;
  for (const std::uint64_t array : arrays) {
    bytes += array + BlockCount(array) * sizeof(std::uint64_t);
  }
  return bytes;
}

template <typename T>
std::string_view Bytes(const std::vector<T>& array) {
  return {reinterpret_cast<const char*>(array.data()), array.size() * sizeof(T)};
}

/// Gives each block of the arrays, once its checksum was found right, to `take(array, offset in
/// it, bytes)`.
template <typename Take>
absl::Status ReadBlocks(const SnapshotBytesSource& source, const SnapshotHead& head, Take take) {
  const auto arrays =
      ArrayBytes(head.map.photon_count(), head.map.has_powers(), head.map.has_directions());
  std::uint64_t offset = head.file_bytes - BodyBytes(arrays);
  std::uint64_t block_number = 0;
  std::vector<char> buffer(sizeof(std::uint64_t) + kBlockBytes);
  for (std::size_t array = 0; array < arrays.size(); ++array) {
    for (std::uint64_t first = 0; first < arrays[array]; first += kBlockBytes, ++block_number) {
      const std::size_t block_bytes = std::min(kBlockBytes, arrays[array] - first);
      const std::span<char> both{buffer.data(), sizeof(std::uint64_t) + block_bytes};
      if (auto status = source.read(offset, both); !status.ok()) return status;
      std::uint64_t checksum = 0;
      std::memcpy(&checksum, both.data(), sizeof(checksum));
      const std::string_view block(both.data() + sizeof(checksum), block_bytes);
      if (XXH3_64bits_withSeed(block.data(), block.size(), head.checksum + block_number) !=
              checksum &&
          !Broken("checksum")) {
        return absl::DataLossError(
            fmt::format("block {} at byte {}: its checksum is wrong", block_number, offset));
      }
      take(array, first, block);
      offset += both.size();
    }
  }
  return absl::OkStatus();
}

/// What a description must say so that a map can be built from it.
absl::Status CheckDescription(const v1::PhotonMap& map, const std::string& request_id) {
  if (auto status = CheckName("name", map.name()); !status.ok()) return status;
  if (!request_id.empty()) {
    if (auto status = CheckName("request id", request_id); !status.ok()) return status;
  }
  if (map.version() == 0 || map.version() == std::numeric_limits<std::uint64_t>::max()) {
    return absl::InvalidArgumentError(fmt::format("version is {}", map.version()));
  }
  if (map.photon_count() == 0 || map.photon_count() >= kLeafBit) {
    return absl::InvalidArgumentError(fmt::format("photon_count is {}", map.photon_count()));
  }
  return absl::OkStatus();
}

}  // namespace

std::uint64_t SnapshotBytes(std::uint64_t photon_count, bool has_powers, bool has_directions) {
  return sizeof(Prefix) + kMaxDescriptionBytes + kMaxNameLength + kMaxRequestBytes +
         BodyBytes(ArrayBytes(photon_count, has_powers, has_directions));
}

absl::Status WriteSnapshot(const v1::PhotonMap& map, const std::string& request_id,
                           const BuildRequest& request, const Photons& photons,
                           const WriteBytes& write) {
  v1::PhotonMap described = map;
  described.clear_device();
  described.clear_device_bytes();
  const std::string description = described.SerializeAsString();
  const std::string request_text = request.SerializeAsString();
  Prefix prefix{.version = kSnapshotVersion,
                .description_bytes = static_cast<std::uint32_t>(description.size()),
                .request_id_bytes = static_cast<std::uint32_t>(request_id.size()),
                .request_bytes = static_cast<std::uint32_t>(request_text.size())};
  std::ranges::copy(kMagic, prefix.magic.begin());
  const std::string texts = description + request_id + request_text;
  prefix.checksum = Sum(prefix, texts);
  for (const std::string_view bytes : {View(prefix), std::string_view(texts)}) {
    if (auto status = write(bytes); !status.ok()) return status;
  }
  std::uint64_t block_number = 0;
  for (const std::string_view array :
       {Bytes(photons.positions), Bytes(photons.powers), Bytes(photons.directions)}) {
    for (std::size_t first = 0; first < array.size(); first += kBlockBytes, ++block_number) {
      const std::string_view block = array.substr(first, kBlockBytes);
      const std::uint64_t checksum =
          XXH3_64bits_withSeed(block.data(), block.size(), prefix.checksum + block_number);
      auto status = write({reinterpret_cast<const char*>(&checksum), sizeof(checksum)});
      if (status.ok()) status = write(block);
      if (!status.ok()) return status;
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<SnapshotHead> ReadSnapshotHead(const SnapshotBytesSource& source) {
  Prefix prefix;
  if (source.size < sizeof(prefix)) {
    return absl::DataLossError(fmt::format("{} bytes are too few", source.size));
  }
  std::span<char> bytes{reinterpret_cast<char*>(&prefix), sizeof(prefix)};
  if (auto status = source.read(0, bytes); !status.ok()) return status;
  if (std::string_view(prefix.magic.data(), prefix.magic.size()) != kMagic) {
    return absl::DataLossError("it does not begin as a snapshot does");
  }
  if (prefix.version > kSnapshotVersion) {
    return absl::UnimplementedError(
        fmt::format("format version {}, this program knows {} at most: a later treelightd wrote it",
                    prefix.version, kSnapshotVersion));
  }
  // Before anything is allocated.
  const std::uint64_t text_bytes =
      std::uint64_t{prefix.description_bytes} + prefix.request_id_bytes + prefix.request_bytes;
  const std::uint32_t max_request_bytes = prefix.version == 1 ? 0 : kMaxRequestBytes;
  if (prefix.version == 0 || Broken("format_version") || prefix.request_bytes > max_request_bytes ||
      prefix.description_bytes > kMaxDescriptionBytes || prefix.request_id_bytes > kMaxNameLength ||
      text_bytes > source.size - sizeof(prefix)) {
    return absl::DataLossError("its head is damaged");
  }
  std::string text(text_bytes, '\0');
  if (auto status = source.read(sizeof(prefix), text); !status.ok()) return status;
  if (Sum(prefix, text) != prefix.checksum) {
    return absl::DataLossError("the checksum of its head is wrong");
  }
  SnapshotHead head;
  head.checksum = prefix.checksum;
  const std::string request = text.substr(text.size() - prefix.request_bytes);
  head.request_id = text.substr(prefix.description_bytes, prefix.request_id_bytes);
  text.resize(prefix.description_bytes);
  // A right checksum does not make it one of ours.
  if (prefix.request_bytes > 0 &&
      (!head.request.ParseFromString(request) || !IsBuildRequest(head.request))) {
    return absl::DataLossError("its request is none of a build");
  }
  if (!head.map.ParseFromString(text)) return absl::DataLossError("its description is no message");
  if (auto status = CheckDescription(head.map, head.request_id); !status.ok()) {
    return absl::DataLossError(fmt::format("its description: {}", std::string(status.message())));
  }
  const auto options = ParseBuildOptions(head.map.options());
  if (!options.ok()) {
    return absl::DataLossError(
        fmt::format("its description: {}", std::string(options.status().message())));
  }
  head.options = *options;
  head.file_bytes = sizeof(prefix) + text_bytes +
                    BodyBytes(ArrayBytes(head.map.photon_count(), head.map.has_powers(),
                                         head.map.has_directions()));
  if (head.file_bytes != source.size) {
    return absl::DataLossError(fmt::format("{} bytes long, {} photons take {}", source.size,
                                           head.map.photon_count(), head.file_bytes));
  }
  return head;
}

absl::StatusOr<Photons> ReadSnapshotPhotons(const SnapshotBytesSource& source,
                                            const SnapshotHead& head) {
  Photons photons;
  try {
    const std::uint64_t photon_count = head.map.photon_count();
    photons.positions.resize(3 * photon_count);
    if (head.map.has_powers()) photons.powers.resize(3 * photon_count);
    if (head.map.has_directions()) photons.directions.resize(2 * photon_count);
    const std::array<char*, 3> arrays = {reinterpret_cast<char*>(photons.positions.data()),
                                         reinterpret_cast<char*>(photons.powers.data()),
                                         reinterpret_cast<char*>(photons.directions.data())};
    const auto status = ReadBlocks(
        source, head, [&](std::size_t array, std::uint64_t first, std::string_view block) {
          std::memcpy(arrays[array] + first, block.data(), block.size());
        });
    if (!status.ok()) return status;
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(
        fmt::format("the server's memory does not hold {} photons at present; repeat later",
                    head.map.photon_count()));
  }
  return photons;
}

absl::Status CheckSnapshotPhotons(const SnapshotBytesSource& source, const SnapshotHead& head) {
  return ReadBlocks(source, head, [](std::size_t, std::uint64_t, std::string_view) {});
}

}  // namespace treelight::server
