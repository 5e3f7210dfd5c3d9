#ifndef TREELIGHT_SERVER_SNAPSHOT_H_
#define TREELIGHT_SERVER_SNAPSHOT_H_

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "core/builder.h"
#include "core/model/photons.h"
#include "server/map_store.h"
#include "treelight/v1/photon_map.pb.h"

// The file of one version of a map: what is needed to build it again, the same bits, and what
// GetPhotonMap tells of it. Numbers are little-endian.
//
//   offset 0   8 B   "TLMAP\r\n" and 0x1a: notices transfers that change line ends
//          8   u32   format version, 2
//         12   u32   bytes of the description, at most 1 MiB
//         16   u32   bytes of the request id, at most 128
//         20   u32   bytes of the request, at most 4096; format 1: 0
//         24   u64   XXH3 of the 24 bytes before and of what follows up to the arrays
//         32         description: v1.PhotonMap of photon_map.proto; then the request id; then the
//                    request that it came with, which no other may use it for: google.protobuf.Any
//                    of a v1.BuildHeader or a v1.RebuildPhotonMapRequest, nothing without an id
//   then the arrays, positions, powers, directions, those that the description says, as in
//   PhotonChunk, each cut into blocks of 1 MiB, the last of an array shorter:
//              u64   XXH3 of the block, its seed the checksum at 24 plus the number of the block in
//                    the file from 0: a block of another place or another file is no block
//                    of this one
//                    the block
//
// The file ends with its last block.
namespace treelight::server {

/// Format version that is written. Older ones are read, newer ones are not.
inline constexpr std::uint32_t kSnapshotVersion = 2;

/// What the head of a snapshot says.
struct SnapshotHead {
  v1::PhotonMap map;       ///< without `device` and `device_bytes`
  std::string request_id;  ///< or empty
  BuildRequest request;    ///< empty: not known, or no id
  BuildOptions options;    ///< of `map`, checked
  std::uint64_t checksum = 0;
  std::uint64_t file_bytes = 0;  ///< of the whole file
};

/// Bytes of a snapshot, in order: `write` gets them in pieces. Returns the first error of `write`.
using WriteBytes = std::function<absl::Status(std::string_view bytes)>;
absl::Status WriteSnapshot(const v1::PhotonMap& map, const std::string& request_id,
                           const BuildRequest& request, const Photons& photons,
                           const WriteBytes& write);

/// Bytes that WriteSnapshot writes at most for `photon_count` photons.
std::uint64_t SnapshotBytes(std::uint64_t photon_count, bool has_powers, bool has_directions);

/// A file, or what stands for one.
struct SnapshotBytesSource {
  std::uint64_t size = 0;  ///< bytes
  /// Fills `to` from `offset` on; [offset, offset + to.size()) lies within `size`.
  std::function<absl::Status(std::uint64_t offset, std::span<char> to)> read;
};

/// Reads the head. DATA_LOSS says what is wrong: any bytes are possible. UNIMPLEMENTED: a later
/// version of this program wrote it.
absl::StatusOr<SnapshotHead> ReadSnapshotHead(const SnapshotBytesSource& source);

/// Reads the arrays that `head`, of the same source, says. DATA_LOSS: a checksum or the length is
/// wrong. RESOURCE_EXHAUSTED: they do not fit the memory.
absl::StatusOr<Photons> ReadSnapshotPhotons(const SnapshotBytesSource& source,
                                            const SnapshotHead& head);

/// Checks the arrays as ReadSnapshotPhotons does, one block in memory at a time.
absl::Status CheckSnapshotPhotons(const SnapshotBytesSource& source, const SnapshotHead& head);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_SNAPSHOT_H_
