// The reader of snapshots. An even first byte: the rest is a file. An odd one: the rest is a
// description, where it is 3 modulo 4 a request, and then a body, around which the checksums are
// made right, so that what is behind them is reached.
#include "server/snapshot.h"

#include <xxhash.h>

#include <cstdint>
#include <cstring>
#include <string>

#include "tests/fuzz/choice.h"
#include "tests/fuzz/require.h"

namespace treelight::server {
namespace {

using fuzz::Require;
using fuzz::RequireRefusal;

void Put(std::string& file, std::uint32_t number) {
  file.append(reinterpret_cast<const char*>(&number), sizeof(number));
}

/// Takes a text off `bytes`, whose first byte is its length.
std::string_view TakeText(std::string_view& bytes) {
  const std::size_t length = bytes.empty() ? 0 : static_cast<unsigned char>(bytes[0]);
  if (!bytes.empty()) bytes.remove_prefix(1);
  const std::string_view text = bytes.substr(0, length);
  bytes.remove_prefix(text.size());
  return text;
}

/// A file of one block an array.
std::string WithChecksums(std::string_view bytes, bool with_request) {
  const std::string_view description = TakeText(bytes);
  const std::string_view request = with_request ? TakeText(bytes) : std::string_view();
  std::string file("TLMAP\r\n\x1a", 8);
  Put(file, kSnapshotVersion);
  Put(file, static_cast<std::uint32_t>(description.size()));
  Put(file, 0);
  Put(file, static_cast<std::uint32_t>(request.size()));
  const std::string texts = std::string(description).append(request), summed = file + texts;
  const std::uint64_t checksum = XXH3_64bits(summed.data(), summed.size());
  file.append(reinterpret_cast<const char*>(&checksum), sizeof(checksum)).append(texts);
  v1::PhotonMap map;
  if (!map.ParseFromArray(description.data(), static_cast<int>(description.size()))) return file;
  std::uint64_t block_number = 0;
  for (const std::uint64_t bytes_per_photon :
       {12, map.has_powers() ? 12 : 0, map.has_directions() ? 4 : 0}) {
    const std::string_view block = bytes.substr(
        0, std::min<std::uint64_t>(bytes.size(), bytes_per_photon * map.photon_count()));
    if (block.empty()) continue;
    const std::uint64_t sum =
        XXH3_64bits_withSeed(block.data(), block.size(), checksum + block_number++);
    file.append(reinterpret_cast<const char*>(&sum), sizeof(sum)).append(block);
    bytes.remove_prefix(block.size());
  }
  return file.append(bytes);
}

void Read(const std::string& file) {
  const SnapshotBytesSource source{
      .size = file.size(), .read = [&file](std::uint64_t offset, std::span<char> to) {
        Require(offset <= file.size() && to.size() <= file.size() - offset, "reads stay inside");
        std::memcpy(to.data(), file.data() + offset, to.size());
        return absl::OkStatus();
      }};
  const auto head = ReadSnapshotHead(source);
  if (!head.ok()) return RequireRefusal(head.status());
  const auto checked = CheckSnapshotPhotons(source, *head);
  const auto photons = ReadSnapshotPhotons(source, *head);
  Require(checked == photons.status(), "both readers agree");
  if (!photons.ok()) return RequireRefusal(photons.status());
  Require(photons->size() == head->map.photon_count(), "as many photons as it says");
  // Numbers that no map can have are the builder's to refuse.
  const auto map = MakeBruteForceBuilder()->Build(*photons, head->options);
  if (!map.ok()) return RequireRefusal(map.status());
  // What was read is written again as the same bytes, but for fields of the description that are
  // not known.
  std::string again;
  const auto written = WriteSnapshot(head->map, head->request_id, head->request, *photons,
                                     [&again](std::string_view bytes) {
                                       again.append(bytes);
                                       return absl::OkStatus();
                                     });
  Require(written.ok(), "what was read can be written");
}

}  // namespace
}  // namespace treelight::server

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace treelight::server;
  const treelight::fuzz::Choice input(data, size);
  const bool with_request = input.which % 4 == 3;
  Read(input.which % 2 == 0 ? input.bytes : WithChecksums(input.bytes, with_request));
  return 0;
}
