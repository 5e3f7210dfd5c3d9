#include "server/service.h"

#include <string_view>
#include <type_traits>
#include <utility>

#include "server/build_call.h"
#include "server/call.h"
#include "server/catalogue.h"
#include "server/gather_call.h"
#include "server/gather_stream.h"
#include "server/rebuild_call.h"

namespace treelight::server {
namespace {

/// Where a call is answered.
enum class Where {
  kInStore,  ///< from the store, once it shows what a data folder holds
  kOnDisk,   ///< on the thread of the disk, where there is a data folder
};

/// A call that needs no device. Owns itself, gone with OnDone.
class QuickCall final : public grpc::ServerUnaryReactor {
 public:
  /// Answers with `handle(state, request, response)`.
  template <typename Request, typename Response>
  QuickCall(State& state, grpc::CallbackServerContext& context, std::string_view method,
            absl::Status (*handle)(State&, const Request&, Response&), const Request& request,
            Response& response, Where where = Where::kInStore)
      : call_(state, context, method) {
    auto answer = [this, &state, handle, &request, &response] {
      Answer(state, handle, request, response);
    };
    if (where == Where::kOnDisk && state.snapshots != nullptr) {
      state.disk.Submit(std::move(answer));
    } else {
      WithNewestMaps(state, std::move(answer));
    }
  }

  void OnDone() override { delete this; }

 private:
  template <typename Request, typename Response>
  void Answer(State& state, absl::Status (*handle)(State&, const Request&, Response&),
              const Request& request, Response& response) {
    RequestRecord record = call_.NewRecord();
    if constexpr (requires { request.version(); }) {
      record.map = request.name();
      record.version = request.version();
    }
    absl::Status status = call_.admission();
    if constexpr (requires { request.name(); }) {
      if (status.ok()) status = call_.CheckRoute(request.name());
    }
    if (status.ok()) status = handle(state, request, response);
    if constexpr (std::is_same_v<Response, v1::PhotonMap>) {
      if (status.ok()) record.version = response.version();
    }
    record.bytes_in = request.ByteSizeLong();
    record.bytes_out = status.ok() ? response.ByteSizeLong() : 0;
    record.timings.set_total_us(watch_.microseconds());
    call_.Log(record, status);
    Finish(call_.End(status));
  }

  Call call_;
  const Stopwatch watch_;
};

}  // namespace

grpc::ServerReadReactor<v1::BuildPhotonMapRequest>* PhotonMapService::BuildPhotonMap(
    grpc::CallbackServerContext* context, v1::BuildPhotonMapResponse* response) {
  return new BuildCall(state_, *context, *response);
}

grpc::ServerUnaryReactor* PhotonMapService::RebuildPhotonMap(
    grpc::CallbackServerContext* context, const v1::RebuildPhotonMapRequest* request,
    v1::BuildPhotonMapResponse* response) {
  return new RebuildCall(state_, *context, *request, *response);
}

grpc::ServerUnaryReactor* PhotonMapService::Gather(grpc::CallbackServerContext* context,
                                                   const v1::GatherRequest* request,
                                                   v1::GatherResponse* response) {
  return new GatherCall(state_, *context, *request, *response);
}

grpc::ServerBidiReactor<v1::GatherRequest, v1::GatherResponse>* PhotonMapService::GatherStream(
    grpc::CallbackServerContext* context) {
  return new server::GatherStream(state_, *context);
}

grpc::ServerUnaryReactor* PhotonMapService::GetPhotonMap(grpc::CallbackServerContext* context,
                                                         const v1::GetPhotonMapRequest* request,
                                                         v1::PhotonMap* response) {
  return new QuickCall(state_, *context, "GetPhotonMap", server::GetPhotonMap, *request, *response);
}

grpc::ServerUnaryReactor* PhotonMapService::ListPhotonMaps(grpc::CallbackServerContext* context,
                                                           const v1::ListPhotonMapsRequest* request,
                                                           v1::ListPhotonMapsResponse* response) {
  return new QuickCall(state_, *context, "ListPhotonMaps", server::ListPhotonMaps, *request,
                       *response);
}

grpc::ServerUnaryReactor* PhotonMapService::DeletePhotonMap(
    grpc::CallbackServerContext* context, const v1::DeletePhotonMapRequest* request,
    v1::DeletePhotonMapResponse* response) {
  return new QuickCall(state_, *context, "DeletePhotonMap", server::DeletePhotonMap, *request,
                       *response, Where::kOnDisk);
}

grpc::ServerUnaryReactor* PhotonMapService::GetServerInfo(grpc::CallbackServerContext* context,
                                                          const v1::GetServerInfoRequest* request,
                                                          v1::ServerInfo* response) {
  return new QuickCall(state_, *context, "GetServerInfo", server::GetServerInfo, *request,
                       *response);
}

}  // namespace treelight::server
