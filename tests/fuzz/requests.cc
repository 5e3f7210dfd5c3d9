// Every converter of requests: the first byte says which, the rest is the message.
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>

#include "server/convert.h"
#include "server/gather_batch.h"
#include "server/upload.h"
#include "tests/fuzz/choice.h"
#include "tests/fuzz/require.h"

namespace treelight::server {
namespace {

using fuzz::Require;
using fuzz::RequireRefusal;

Limits SmallLimits() {
  Limits limits;
  limits.max_photons = 1000;
  limits.max_queries = 1000;
  limits.max_chunk_bytes = 10'000;
  return limits;
}

/// Four photons with all that they can have.
const StoredMap& Map() {
  static const StoredMap map{
      .name = "map",
      .version = 1,
      .request_id = {},
      .options = {},
      .gatherer = *MakeBruteForceBuilder()->Build({.positions = std::vector<float>(12),
                                                   .powers = std::vector<float>(12),
                                                   .directions = std::vector<std::int16_t>(8)},
                                                  {}),
      .created = {},
      .expires = {}};
  return map;
}

void CheckPlan(const absl::StatusOr<BuildPlan>& plan) {
  if (!plan.ok()) return RequireRefusal(plan.status());
  Require(CheckName("name", plan->name).ok(), "a plan has a name");
  Require(plan->photon_count >= 1 && plan->photon_count <= 1000, "a plan keeps the limits");
  Require(CheckBuildOptions(plan->options).ok(), "a plan has options that can be built");
  Require(plan->time_to_live.count() >= 0 && plan->time_to_live <= kMaxTimeToLive, "time to live");
}

void Header(const std::string& bytes) {
  v1::BuildHeader header;
  if (header.ParseFromString(bytes)) CheckPlan(ParseBuildHeader(header, SmallLimits()));
}

void Rebuild(const std::string& bytes) {
  v1::RebuildPhotonMapRequest request;
  if (request.ParseFromString(bytes)) CheckPlan(ParseRebuild(request, Map()));
}

/// The BuildPhotonMapRequest of the chunk `bytes`, its length in three bytes.
std::string RequestOf(const std::string& bytes) {
  const auto digit = [&](int shift) { return static_cast<char>(bytes.size() >> shift & 0x7f); };
  return std::string("\x12") + static_cast<char>(digit(0) | 0x80) +
         static_cast<char>(digit(7) | 0x80) + digit(14) + bytes;
}

Pieces Split(std::string_view bytes) {
  constexpr std::size_t kPieceBytes = 7;
  Pieces pieces;
  for (std::size_t first = 0; first < bytes.size(); first += kPieceBytes)
    pieces.push_back(bytes.substr(first, kPieceBytes));
  return pieces;
}

/// Whether `pieces` hold `bytes`.
bool Hold(const Pieces& pieces, std::string_view bytes) {
  for (const std::string_view piece : pieces) {
    if (!bytes.starts_with(piece)) return false;
    bytes.remove_prefix(piece.size());
  }
  return bytes.empty();
}

/// A header, then chunks: the messages of an upload one after the other, each behind its length in
/// two bytes.
void WholeUpload(std::string_view bytes) {
  std::optional<Upload> upload;
  BuildPlan plan;
  while (bytes.size() >= 2) {
    const std::size_t length = static_cast<unsigned char>(bytes[0]) |
                               static_cast<std::size_t>(static_cast<unsigned char>(bytes[1])) << 8;
    bytes.remove_prefix(2);
    const std::string message(bytes.substr(0, length));
    bytes.remove_prefix(std::min(length, bytes.size()));
    if (!upload) {
      v1::BuildHeader header;
      if (!header.ParseFromString(message)) return;
      const auto parsed = ParseBuildHeader(header, SmallLimits());
      if (!parsed.ok()) return;
      plan = *parsed;
      auto begun = Upload::Start(plan, SmallLimits());
      Require(begun.ok(), "a small upload begins");
      upload = *std::move(begun);
      continue;
    }
    const std::string request = RequestOf(message);
    const auto arrays = FindArrays(Split(request));
    v1::PhotonChunk chunk;
    const bool parsed = chunk.ParseFromString(message);
    Require(!arrays || (parsed && Hold(arrays->positions, chunk.positions()) &&
                        Hold(arrays->powers, chunk.powers()) &&
                        Hold(arrays->directions, chunk.directions())),
            "arrays are found where protobuf finds them");
    if (!parsed) return;
    if (const auto added = upload->Add(arrays ? *arrays : ArraysOf(chunk)); !added.ok())
      return RequireRefusal(added);
    Require(upload->received() <= plan.photon_count, "no more than announced");
  }
  if (!upload) return;
  const auto photons = std::move(*upload).Finish();
  if (!photons.ok()) return RequireRefusal(photons.status());
  Require(CheckBuild(*photons, plan.options).ok(), "what an upload gives can be built from");
}

void Gather(const std::string& bytes) {
  v1::GatherRequest request;
  if (!request.ParseFromString(bytes)) return;
  const Gatherer& map = *Map().gatherer;
  const auto batch = ParseGather(request, map, SmallLimits());
  if (!batch.ok()) return RequireRefusal(batch.status());
  Require(batch->size() >= 1 && batch->size() <= 1000, "a batch keeps the limits");
  Require(batch->size() == QueryCount(request), "a batch has the queries of its request");
  Require(batch->largest_move >= 0 && batch->largest_move < 1e15f, "queries are moved by steps");
  const auto answer = map.Gather(batch->queries(0, batch->size()), batch->options);
  if (!answer.ok()) RequireRefusal(answer.status());
}

}  // namespace
}  // namespace treelight::server

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace treelight::server;
  const treelight::fuzz::Choice input(data, size);
  switch (input.which % 4) {
    case 0:
      Header(input.bytes);
      break;
    case 1:
      Rebuild(input.bytes);
      break;
    case 2:
      WholeUpload(input.bytes);
      break;
    default:
      Gather(input.bytes);
  }
  return 0;
}
