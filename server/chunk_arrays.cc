#include "server/chunk_arrays.h"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace treelight::server {
namespace {

/// Tag of the field `number` where it holds a length and as many bytes (protobuf's wire type 2).
constexpr std::uint8_t LengthDelimited(int number) {
  return static_cast<std::uint8_t>(number << 3 | 2);
}

/// Reads bytes that lie in pieces, from the first one on.
class Reader {
 public:
  explicit Reader(std::span<const std::string_view> pieces) : pieces_(pieces) {
    for (const std::string_view piece : pieces) left_ += piece.size();
  }

  std::size_t left() const { return left_; }  ///< bytes

  /// The next byte, of which there is one.
  std::uint8_t ReadByte() {
    while (first_ == pieces_.front().size()) NextPiece();
    --left_;
    return static_cast<std::uint8_t>(pieces_.front()[first_++]);
  }

  /// The next number, base 128, lowest digits first, at most four of them; none where that is not
  /// what comes.
  std::optional<std::size_t> ReadNumber() {
    std::size_t number = 0;
    for (int shift = 0; shift < 28 && left_ > 0; shift += 7) {
      const std::uint8_t digit = ReadByte();
      number |= std::size_t{digit & 0x7fu} << shift;
      if (digit < 0x80) return number;
    }
    return std::nullopt;
  }

  /// The next `size` bytes, of which there are as many, to the end of `bytes`.
  void Take(std::size_t size, Pieces& bytes) {
    left_ -= size;
    while (size > 0) {
      if (first_ == pieces_.front().size()) NextPiece();
      const std::string_view part = pieces_.front().substr(first_, size);
      if (!part.empty()) bytes.push_back(part);
      first_ += part.size();
      size -= part.size();
    }
  }

 private:
  void NextPiece() {
    pieces_ = pieces_.subspan(1);
    first_ = 0;
  }

  std::span<const std::string_view> pieces_;
  std::size_t first_ = 0;  // byte of the first piece
  std::size_t left_ = 0;
};

}  // namespace

std::size_t Length(const Pieces& pieces) {
  return std::accumulate(
      pieces.begin(), pieces.end(), std::size_t{0},
      [](std::size_t sum, std::string_view piece) { return sum + piece.size(); });
}

ChunkArrays ArraysOf(const v1::PhotonChunk& chunk) {
  return {.positions = {chunk.positions()},
          .powers = {chunk.powers()},
          .directions = {chunk.directions()}};
}

std::optional<ChunkArrays> FindArrays(std::span<const std::string_view> message) {
  Reader reader(message);
  if (reader.left() == 0 ||
      reader.ReadByte() != LengthDelimited(v1::BuildPhotonMapRequest::kChunkFieldNumber)) {
    return std::nullopt;
  }
  if (const auto size = reader.ReadNumber(); !size || *size != reader.left()) return std::nullopt;
  ChunkArrays arrays;
  while (reader.left() > 0) {
    const std::uint8_t tag = reader.ReadByte();
    Pieces* const array =
        tag == LengthDelimited(v1::PhotonChunk::kPositionsFieldNumber)    ? &arrays.positions
        : tag == LengthDelimited(v1::PhotonChunk::kPowersFieldNumber)     ? &arrays.powers
        : tag == LengthDelimited(v1::PhotonChunk::kDirectionsFieldNumber) ? &arrays.directions
                                                                          : nullptr;
    const auto size = reader.ReadNumber();
    // The last of several would count.
    if (array == nullptr || !array->empty() || !size || *size > reader.left()) return std::nullopt;
    reader.Take(*size, *array);
  }
  return arrays;
}

}  // namespace treelight::server
