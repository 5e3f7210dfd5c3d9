#include "client/photon_map_client.h"

#include <utility>

#include "client/connection.h"
#include "client/photon_map_client_impl.h"

namespace treelight::client {
absl::StatusOr<std::unique_ptr<PhotonMapClient>> PhotonMapClient::Connect(
    const std::string& target, const ConnectionOptions& options,
    std::chrono::milliseconds timeout) {
  auto channel = MakeChannel(target, options);
  if (!channel.ok()) return channel.status();
  return std::make_unique<PhotonMapClient>(*std::move(channel), timeout);
}

PhotonMapClient::PhotonMapClient(const std::string& target, std::chrono::milliseconds timeout)
    : PhotonMapClient(*MakeChannel(target, {}), timeout) {}

PhotonMapClient::PhotonMapClient(std::shared_ptr<grpc::Channel> channel,
                                 std::chrono::milliseconds timeout)
    : impl_(std::make_unique<Impl>(std::move(channel), timeout)) {}

PhotonMapClient::~PhotonMapClient() = default;

void PhotonMapClient::SetRetryPatience(std::chrono::milliseconds patience) {
  impl_->retry_patience = patience;
}

std::chrono::milliseconds PhotonMapClient::RetryPatience() const { return impl_->retry_patience; }

absl::StatusOr<v1::ServerInfo> PhotonMapClient::GetServerInfo() {
  const Deadline deadline = impl_->NextDeadline();
  return impl_->Repeat(deadline, [&] {
    return impl_->Call(&v1::PhotonMapService::Stub::GetServerInfo, v1::GetServerInfoRequest(),
                       deadline);
  });
}

absl::StatusOr<std::vector<v1::PhotonMap>> PhotonMapClient::ListPhotonMaps() {
  const Deadline deadline = impl_->NextDeadline();
  auto response = impl_->Repeat(deadline, [&] {
    return impl_->Call(&v1::PhotonMapService::Stub::ListPhotonMaps, v1::ListPhotonMapsRequest(),
                       deadline);
  });
  if (!response.ok()) return response.status();
  return std::vector<v1::PhotonMap>(response->maps().begin(), response->maps().end());
}

absl::StatusOr<v1::PhotonMap> PhotonMapClient::GetPhotonMap(const MapRef& map) {
  const Deadline deadline = impl_->NextDeadline();
  return impl_->Repeat(deadline, [&] { return impl_->Describe(map, deadline); });
}

absl::StatusOr<v1::PhotonMap> PhotonMapClient::Impl::Describe(const MapRef& map,
                                                              Deadline deadline) {
  v1::GetPhotonMapRequest request;
  request.set_name(map.name);
  request.set_version(map.version);
  return Call(&v1::PhotonMapService::Stub::GetPhotonMap, request, deadline);
}

absl::StatusOr<std::uint32_t> PhotonMapClient::DeletePhotonMap(const MapRef& map) {
  v1::DeletePhotonMapRequest request;
  request.set_name(map.name);
  request.set_version(map.version);
  const auto response =
      impl_->Call(&v1::PhotonMapService::Stub::DeletePhotonMap, request, impl_->NextDeadline());
  if (!response.ok()) return response.status();
  return response->deleted();
}

absl::StatusOr<v1::ServerLimits> PhotonMapClient::Impl::GetLimits(Deadline deadline) {
  {
    const std::lock_guard lock(mutex_);
    if (limits_) return *limits_;
  }
  const auto info =
      Call(&v1::PhotonMapService::Stub::GetServerInfo, v1::GetServerInfoRequest(), deadline);
  if (!info.ok()) return info.status();
  v1::ServerLimits limits = info->limits();
  if (limits.max_message_bytes() == 0) limits.set_max_message_bytes(4 << 20);
  if (limits.max_chunk_bytes() == 0) limits.set_max_chunk_bytes(1 << 20);
  if (limits.max_queries() == 0) limits.set_max_queries(1 << 16);
  const std::lock_guard lock(mutex_);
  limits_ = limits;
  return limits;
}

void PhotonMapClient::Impl::ForgetLimits() {
  const std::lock_guard lock(mutex_);
  limits_.reset();
}

}  // namespace treelight::client
