#include "server/service.h"

#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "fmt/format.h"
#include "server/build_call.h"
#include "server/call.h"
#include "server/catalogue.h"
#include "server/gather_call.h"
#include "server/gather_stream.h"
#include "server/late_unary.h"
#include "server/rebuild_call.h"
#include "server/room.h"

namespace treelight::server {
namespace {

/// Where a call is answered.
enum class Where {
  kInStore,  ///< from the store, once it shows what a data folder holds
  kOnDisk,   ///< on the thread of the disk, where there is a data folder
};

/// A call that needs no device.
template <typename Request, typename Response>
class QuickCall final : public LateUnary<Request, Response> {
 public:
  /// Writes the response, or says why there is none.
  using Handle = absl::Status (*)(State&, const Request&, Response&);

  QuickCall(State& state, grpc::CallbackServerContext& context, std::string_view method,
            Handle handle, Where where)
      : state_(state), call_(state, context, method), handle_(handle), where_(where) {
    this->Open();
  }

 private:
  Call& call() override { return call_; }

  void Run(const absl::Status& status) override {
    if (!status.ok()) return Answer(status);
    auto answer = [this] { Answer(call_.admission()); };
    if (where_ == Where::kOnDisk && state_.snapshots != nullptr) {
      state_.disk.Submit(std::move(answer));
    } else {
      WithNewestMaps(state_, std::move(answer));
    }
  }

  void Answer(absl::Status status) {
    const Request& request = this->request();
    Response& response = this->response();
    RequestRecord record = call_.NewRecord();
    if constexpr (requires { request.version(); }) {
      record.map = request.name();
      record.version = request.version();
    }
    if constexpr (requires { request.name(); }) {
      if (status.ok()) status = call_.CheckRoute(request.name());
    }
    if (status.ok()) status = handle_(state_, request, response);
    if constexpr (std::is_same_v<Response, v1::PhotonMap>) {
      if (status.ok()) record.version = response.version();
    }
    record.bytes_in = request.ByteSizeLong();
    if (status.ok()) status = TakeMemory(response.ByteSizeLong());
    record.bytes_out = status.ok() ? response.ByteSizeLong() : 0;
    record.timings.set_total_us(watch_.microseconds());
    call_.Log(record, status);
    this->End(call_.End(status));
  }

  /// For an answer of `bytes` until the client has taken it, unless it is small.
  absl::Status TakeMemory(std::uint64_t bytes) {
    constexpr std::uint64_t kTimes = 4;  // fields of messages, and their bytes in gRPC
    if (bytes <= this->kFewBytes) return absl::OkStatus();
    auto taken = TakeForCall(state_, Holder::kAnswers, kTimes * bytes,
                             fmt::format("an answer of {} bytes", bytes));
    if (!taken.ok()) return taken.status();
    answer_memory_ = *std::move(taken);
    return absl::OkStatus();
  }

  State& state_;
  Call call_;
  MemoryBudget::Share answer_memory_;
  const Handle handle_;
  const Where where_;
  const Stopwatch watch_;
};

/// Index of a method of the service, as its stubs count them.
int IndexOf(const std::string& method) {
  const auto& file = *v1::BuildHeader::descriptor()->file();
  return file.FindServiceByName("PhotonMapService")->FindMethodByName(method)->index();
}

}  // namespace

/// `make(state, context, method)` makes the LateUnary that handles `method`.
template <typename Request, typename Response, typename Make>
void PhotonMapService::HandleLate(const std::string& method, Make make) {
  const int index = IndexOf(method);
  MarkMethodStreamed(index, nullptr);
  MarkMethodCallback(index, new grpc::internal::CallbackBidiHandler<Request, Response>(
                                [this, method, make](grpc::CallbackServerContext* context)
                                    -> grpc::ServerBidiReactor<Request, Response>* {
                                  return make(state_, *context, method);
                                }));
}

PhotonMapService::PhotonMapService(State& state) : state_(state) {
  using BuildHandler =
      grpc::internal::CallbackClientStreamingHandler<grpc::ByteBuffer, v1::BuildPhotonMapResponse>;
  MarkMethodCallback(IndexOf("BuildPhotonMap"),
                     new BuildHandler([this](grpc::CallbackServerContext* context,
                                             v1::BuildPhotonMapResponse* response) {
                       return new BuildCall(state_, *context, *response);
                     }));
  HandleLate<v1::RebuildPhotonMapRequest, v1::BuildPhotonMapResponse>(
      "RebuildPhotonMap", [](State& all, grpc::CallbackServerContext& context, const auto&) {
        return new RebuildCall(all, context);
      });
  HandleLate<v1::GatherRequest, v1::GatherResponse>(
      "Gather", [](State& all, grpc::CallbackServerContext& context, const auto&) {
        return new GatherCall(all, context);
      });
  const auto quick = [this]<typename Request, typename Response>(
                         const char* name,
                         absl::Status (*handle)(State&, const Request&, Response&), Where where) {
    HandleLate<Request, Response>(
        name, [handle, where](State& all, grpc::CallbackServerContext& context,
                              const std::string& method) {
          return new QuickCall<Request, Response>(all, context, method, handle, where);
        });
  };
  quick("GetPhotonMap", server::GetPhotonMap, Where::kInStore);
  quick("ListPhotonMaps", server::ListPhotonMaps, Where::kInStore);
  quick("DeletePhotonMap", server::DeletePhotonMap, Where::kOnDisk);
  quick("GetServerInfo", server::GetServerInfo, Where::kInStore);
}

grpc::ServerBidiReactor<v1::GatherRequest, v1::GatherResponse>* PhotonMapService::GatherStream(
    grpc::CallbackServerContext* context) {
  return new server::GatherStream(state_, *context);
}

}  // namespace treelight::server
