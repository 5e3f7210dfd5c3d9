#include "tests/faults/stuck_clients.h"

#include <chrono>
#include <memory>
#include <string>

#include "client/gather_wire.h"
#include "fmt/format.h"
#include "tests/faults/channel.h"
#include "tests/faults/model.h"

namespace treelight::faults {
namespace {

constexpr std::chrono::seconds kListTimeout{4};

/// A channel that takes little of an answer that nobody reads.
std::shared_ptr<grpc::Channel> MakeNarrowChannel(const std::string& address) {
  grpc::ChannelArguments arguments = OwnConnection();
  arguments.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
  arguments.SetInt(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, 65'535);
  return MakeChannel(address, arguments);
}

}  // namespace

StuckClients::StuckClients(int port) {
  const std::string address = fmt::format("127.0.0.1:{}", port);
  for (const bool upload : {true, false}) {
    threads_.emplace_back([this, upload, address] {
      const auto stub = v1::PhotonMapService::NewStub(MakeNarrowChannel(address));
      upload ? Upload(*stub) : Read(*stub);
    });
  }
}

StuckClients::~StuckClients() {
  {
    const std::lock_guard lock(mutex_);
    over_ = true;
  }
  let_go_.notify_all();
  for (auto& thread : threads_) thread.join();
}

void StuckClients::WaitUntilLetGo() {
  std::unique_lock lock(mutex_);
  let_go_.wait(lock, [this] { return over_; });
}

void StuckClients::Upload(v1::PhotonMapService::Stub& stub) {
  grpc::ClientContext context;
  v1::BuildPhotonMapResponse response;
  const auto upload = stub.BuildPhotonMap(&context, &response);
  v1::BuildPhotonMapRequest header;
  header.mutable_header()->set_name("stuck");
  header.mutable_header()->set_photon_count(1000);
  upload->Write(header);
  WaitUntilLetGo();
  context.TryCancel();
  upload->Finish();
}

/// Takes the first answer of a stream of large ones.
void StuckClients::Read(v1::PhotonMapService::Stub& stub) {
  v1::ListPhotonMapsResponse maps;
  {
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + kListTimeout);
    if (!stub.ListPhotonMaps(&context, {}, &maps).ok() || maps.maps().empty()) return;
  }
  const QuerySet queries{.count = 5000, .seed = 1, .k = 64, .radius = 1};
  const auto positions = MakeQueries(queries);
  const v1::PhotonMap& map = maps.maps(0);
  const auto batch = client::MakeGatherRequest({.name = map.name(), .version = map.version()}, 0,
                                               {.positions = positions}, MakeOptions(queries));
  grpc::ClientContext context;
  const auto stream = stub.GatherStream(&context);
  stream->Write(batch);
  v1::GatherResponse response;
  stream->Read(&response);
  WaitUntilLetGo();
  context.TryCancel();
  stream->Finish();
}

}  // namespace treelight::faults
