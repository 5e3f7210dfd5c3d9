#include "server/rebuild_call.h"

#include "fmt/format.h"
#include "server/upload.h"

namespace treelight::server {

RebuildCall::RebuildCall(State& state, grpc::CallbackServerContext& context)
    : state_(state), job_(state, context, "RebuildPhotonMap", response()) {
  Open();
}

void RebuildCall::Run(const absl::Status& status) {
  if (!status.ok()) return Ended(status);
  job_.record().bytes_in = request().ByteSizeLong();
  WithNewestMaps(state_, [this] { Begin(); });
}

void RebuildCall::Begin() {
  const absl::StatusOr<MapHandle> source =
      job_.call().admission().ok() ? Prepare() : job_.call().admission();
  if (!source.ok()) return Ended(source.status());
  // The handle keeps the photons while the call waits, even where the map is deleted.
  job_.Submit([map = *source] { return map->gatherer->ReadPhotons(); },
              [this](const absl::Status& status) { Ended(status); });
}

/// The map whose photons are taken, with room for another one; null where none is needed.
absl::StatusOr<MapHandle> RebuildCall::Prepare() {
  const v1::RebuildPhotonMapRequest& request = this->request();
  RequestRecord& record = job_.record();
  record.options = request.options();
  record.map = request.new_name().empty() ? request.name() : request.new_name();
  if (auto status = CheckName("name", request.name()); !status.ok()) return status;
  if (auto status = job_.call().CheckRoute(record.map); !status.ok()) return status;
  job_.Identify(request.request_id(), request);
  const auto answered = job_.AnsweredByAnEarlierCall();  // also where the source has gone since
  if (!answered.ok()) return answered.status();
  if (*answered) return MapHandle();
  auto source = state_.store.Find(request.name(), request.version());
  if (!source.ok()) return source.status();
  record.source = fmt::format("{}@{}", (*source)->name, (*source)->version);
  record.photons = (*source)->gatherer->photon_count();
  const auto plan = ParseRebuild(request, **source);
  if (!plan.ok()) return plan.status();
  const std::string what = fmt::format("map '{}' has {} photons", *record.source, *record.photons);
  if (auto status = job_.Admit(*plan, PhotonBytes(*plan), what); !status.ok()) return status;
  return source;
}

}  // namespace treelight::server
