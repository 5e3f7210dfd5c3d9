#include <utility>

#include "client/gather_stream.h"
#include "client/gather_wire.h"
#include "client/photon_map_client.h"
#include "client/photon_map_client_impl.h"

namespace treelight::client {

struct GatherPipeline::Impl {
  MapRef map;
  GatherOptions options;
  WireOptions wire;
  std::uint64_t sent_count = 0;  // batches
  GatherStream stream;
};

GatherPipeline::GatherPipeline(PhotonMapClient& client, MapRef map, GatherOptions options,
                               WireOptions wire)
    : impl_(new Impl{.map = map,
                     .options = options,
                     .wire = wire,
                     .stream{*client.impl_->stub, map.name, /*deadline=*/Deadline::max(),
                             client.impl_->timeout}}) {}

GatherPipeline::~GatherPipeline() = default;

absl::Status GatherPipeline::Send(const GatherQueries& queries) {
  if (const auto status = CheckQueries(queries, impl_->wire); !status.ok()) return status;
  return impl_->stream.Send(
      MakeGatherRequest(impl_->map, impl_->sent_count++, queries, impl_->options, impl_->wire));
}

absl::StatusOr<GatherAnswer> GatherPipeline::Receive() { return impl_->stream.Receive(); }

}  // namespace treelight::client
