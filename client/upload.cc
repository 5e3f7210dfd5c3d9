#include <algorithm>
#include <array>
#include <random>
#include <span>

#include "client/photon_map_client.h"
#include "client/photon_map_client_impl.h"
#include "client/upload_call.h"
#include "fmt/format.h"

// PhotonMapClient::BuildPhotonMap, whose photons go to the server in chunks, and RebuildPhotonMap.
namespace treelight::client {
namespace {

constexpr std::uint64_t kMaxChunkBytes = 1 << 20;  // of arrays, where the server allows more

std::string RandomId() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}{:08x}{:08x}", random(), random(), random(), random());
}

std::uint64_t Milliseconds(std::chrono::milliseconds time) {
  return static_cast<std::uint64_t>(std::max<std::int64_t>(0, time.count()));
}

absl::Status CheckLengths(const Photons& photons) {
  const std::size_t n = photons.size();
  if (photons.positions.size() != 3 * n) {
    return absl::InvalidArgumentError(
        fmt::format("positions: {} numbers are no multiple of 3", photons.positions.size()));
  }
  if (!photons.powers.empty() && photons.powers.size() != 3 * n) {
    return absl::InvalidArgumentError(
        fmt::format("powers: {} numbers, expected {} or none", photons.powers.size(), 3 * n));
  }
  if (!photons.directions.empty() && photons.directions.size() != 2 * n) {
    return absl::InvalidArgumentError(fmt::format("directions: {} numbers, expected {} or none",
                                                  photons.directions.size(), 2 * n));
  }
  return absl::OkStatus();
}

v1::BuildPhotonMapRequest MakeHeader(const std::string& name, const Photons& photons,
                                     const UploadOptions& options, const std::string& request_id) {
  v1::BuildPhotonMapRequest request;
  v1::BuildHeader& header = *request.mutable_header();
  header.set_name(name);
  header.set_photon_count(photons.size());
  header.set_has_powers(!photons.powers.empty());
  header.set_has_directions(!photons.directions.empty());
  *header.mutable_options() = options.build;
  header.set_time_to_live_ms(Milliseconds(options.time_to_live));
  header.set_request_id(request_id);
  return request;
}

// Puts the numbers of the photons [first, first + count), `width` numbers each, into `bytes`;
// nothing of an empty array.
template <typename T>
void PutBytes(const std::vector<T>& array, std::size_t width, std::size_t first, std::size_t count,
              std::string& bytes) {
  if (array.empty()) return;
  bytes.assign(reinterpret_cast<const char*>(&array[width * first]), width * count * sizeof(T));
}

// Makes `request` a chunk, in the memory that it has.
void PutChunk(const Photons& photons, std::size_t first, std::size_t count,
              v1::BuildPhotonMapRequest& request) {
  v1::PhotonChunk& chunk = *request.mutable_chunk();
  PutBytes(photons.positions, 3, first, count, *chunk.mutable_positions());
  PutBytes(photons.powers, 3, first, count, *chunk.mutable_powers());
  PutBytes(photons.directions, 2, first, count, *chunk.mutable_directions());
}

std::size_t PhotonsPerChunk(const Photons& photons, const v1::ServerLimits& limits) {
  const std::size_t photon_bytes = 3 * sizeof(float) +
                                   (photons.powers.empty() ? 0 : 3 * sizeof(float)) +
                                   (photons.directions.empty() ? 0 : 2 * sizeof(std::int16_t));
  return std::max<std::size_t>(1,
                               std::min(kMaxChunkBytes, limits.max_chunk_bytes()) / photon_bytes);
}

absl::StatusOr<v1::BuildPhotonMapResponse> Checked(
    absl::StatusOr<v1::BuildPhotonMapResponse> response) {
  if (response.ok() && (response->map().name().empty() || response->map().version() == 0)) {
    return absl::InternalError("malformed answer from the server: it names no map");
  }
  return response;
}

// One attempt. The server may answer before it has read all, when it knows the request id.
absl::StatusOr<v1::BuildPhotonMapResponse> Upload(v1::PhotonMapService::Stub& stub,
                                                  const v1::BuildPhotonMapRequest& header,
                                                  const Photons& photons,
                                                  std::size_t photons_per_chunk,
                                                  const UploadOptions& options, Deadline deadline) {
  std::array<v1::BuildPhotonMapRequest, 2> chunks;  // one is made while the other is written
  UploadCall call(stub, header.header().name(), deadline);
  bool open = call.Write(header);
  std::size_t next = 0;
  for (std::size_t first = 0; open && first < photons.size(); first += photons_per_chunk) {
    const std::size_t count = std::min(photons_per_chunk, photons.size() - first);
    PutChunk(photons, first, count, chunks[next]);
    open = call.Write(chunks[next]);
    next = 1 - next;
    if (open && options.progress) options.progress(first + count);
  }
  return Checked(call.Finish());
}

}  // namespace

absl::StatusOr<v1::BuildPhotonMapResponse> PhotonMapClient::BuildPhotonMap(
    const std::string& name, const Photons& photons, const UploadOptions& options) {
  if (const auto status = CheckLengths(photons); !status.ok()) return status;
  const Deadline deadline = impl_->NextDeadline();
  const auto header = MakeHeader(name, photons, options,
                                 options.request_id.empty() ? RandomId() : options.request_id);
  // A call that broke leaves open whether the map was built: its id makes it safe to ask again.
  using Response = absl::StatusOr<v1::BuildPhotonMapResponse>;
  return impl_->Repeat(deadline, [&]() -> Response {
    const auto limits = impl_->GetLimits(deadline);
    if (!limits.ok()) return limits.status();
    return Upload(*impl_->stub, header, photons, PhotonsPerChunk(photons, *limits), options,
                  deadline);
  });
}

absl::StatusOr<v1::BuildPhotonMapResponse> PhotonMapClient::RebuildPhotonMap(
    const MapRef& source, const RebuildOptions& options) {
  const Deadline deadline = impl_->NextDeadline();
  v1::RebuildPhotonMapRequest request;
  request.set_name(source.name);
  request.set_version(source.version);
  request.set_new_name(options.name);
  *request.mutable_options() = options.build;
  request.set_time_to_live_ms(Milliseconds(options.time_to_live));
  request.set_request_id(options.request_id.empty() ? RandomId() : options.request_id);
  return impl_->Repeat(deadline, [&] {
    return Checked(impl_->Call(&v1::PhotonMapService::Stub::RebuildPhotonMap, request, deadline));
  });
}

}  // namespace treelight::client
