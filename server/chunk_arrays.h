#ifndef TREELIGHT_SERVER_CHUNK_ARRAYS_H_
#define TREELIGHT_SERVER_CHUNK_ARRAYS_H_

#include <cstddef>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {

/// Bytes that lie in several places, one after the other; they are somebody else's.
using Pieces = std::vector<std::string_view>;

std::size_t Length(const Pieces& pieces);

/// The arrays of a PhotonChunk where they lie. Their numbers may lie across pieces, and unaligned.
struct ChunkArrays {
  Pieces positions{}, powers{}, directions{};
};

ChunkArrays ArraysOf(const v1::PhotonChunk& chunk);

/// The arrays of `message`, a BuildPhotonMapRequest that holds a chunk, found without a copy of
/// them: of a message as all serialisers write it, each array once and nothing beside. None: it is
/// something else, a message perhaps all the same.
std::optional<ChunkArrays> FindArrays(std::span<const std::string_view> message);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_CHUNK_ARRAYS_H_
