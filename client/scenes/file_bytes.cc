#include "client/scenes/file_bytes.h"

#include <lzma.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <memory>

#include "absl/status/status.h"
#include "client/regular_file.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::size_t kChunk = 1 << 16;                             // bytes read at a time
constexpr std::uint64_t kDecoderMemory = std::uint64_t{128} << 20;  // `xz -9` needs 65 MiB

struct EndDecoder {
  void operator()(lzma_stream* stream) const { lzma_end(stream); }
};

absl::Status TooLarge(const std::string& path, std::uint64_t max_size) {
  return absl::ResourceExhaustedError(
      fmt::format("{}: more than {} bytes, which is the limit", path, max_size));
}

/// What a return code of liblzma means for whoever has the file.
absl::Status DecoderError(const std::string& path, lzma_ret code, std::uint64_t byte) {
  switch (code) {
    case LZMA_FORMAT_ERROR:
      return absl::InvalidArgumentError(fmt::format("{}: no xz file", path));
    case LZMA_MEMLIMIT_ERROR:
      return absl::ResourceExhaustedError(fmt::format(
          "{}: unpacking takes more than {} MiB of memory", path, kDecoderMemory >> 20));
    case LZMA_MEM_ERROR:
      return absl::ResourceExhaustedError(fmt::format("{}: no memory to unpack it", path));
    case LZMA_BUF_ERROR:
      return absl::InvalidArgumentError(
          fmt::format("{}: the xz file ends early, after {} bytes", path, byte));
    default:
      return absl::InvalidArgumentError(
          fmt::format("{}: the xz file is damaged, seen near byte {}", path, byte));
  }
}

absl::StatusOr<std::string> Unpack(std::istream& stream, const std::string& path,
                                   std::uint64_t max_size) {
  lzma_stream decoder = LZMA_STREAM_INIT;
  const std::unique_ptr<lzma_stream, EndDecoder> owner(&decoder);
  if (const lzma_ret code = lzma_stream_decoder(&decoder, kDecoderMemory, LZMA_CONCATENATED);
      code != LZMA_OK) {
    return DecoderError(path, code, 0);
  }
  std::string bytes;
  std::array<char, kChunk> packed{}, unpacked{};
  for (lzma_ret code = LZMA_OK; code != LZMA_STREAM_END;) {
    if (decoder.avail_in == 0 && stream) {
      stream.read(packed.data(), packed.size());
      if (stream.bad()) return absl::DataLossError(fmt::format("{}: cannot be read", path));
      decoder.next_in = reinterpret_cast<const std::uint8_t*>(packed.data());
      decoder.avail_in = static_cast<std::size_t>(stream.gcount());
    }
    decoder.next_out = reinterpret_cast<std::uint8_t*>(unpacked.data());
    decoder.avail_out = unpacked.size();
    code = lzma_code(&decoder, stream ? LZMA_RUN : LZMA_FINISH);
    if (code != LZMA_OK && code != LZMA_STREAM_END) {
      return DecoderError(path, code, decoder.total_in);
    }
    const std::size_t count = unpacked.size() - decoder.avail_out;
    if (bytes.size() + count > max_size) return TooLarge(path, max_size);
    bytes.append(unpacked.data(), count);
  }
  return bytes;
}

}  // namespace

absl::StatusOr<std::string> ReadFileBytes(const std::string& path, std::uint64_t max_size) {
  if (auto status = CheckRegularFile(path); !status.ok()) return status;
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return absl::ErrnoToStatus(errno != 0 ? errno : EIO, path);
  if (path.ends_with(".xz")) return Unpack(stream, path, max_size);
  std::string bytes;
  for (std::array<char, kChunk> chunk; stream;) {
    stream.read(chunk.data(), chunk.size());
    bytes.append(chunk.data(), static_cast<std::size_t>(stream.gcount()));
    if (bytes.size() > max_size) return TooLarge(path, max_size);
  }
  if (stream.bad()) return absl::DataLossError(fmt::format("{}: cannot be read", path));
  return bytes;
}

}  // namespace treelight::client
