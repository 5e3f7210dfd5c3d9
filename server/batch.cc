#include "server/batch.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "server/answer.h"

namespace treelight::server {
namespace {

std::uint64_t Sum(const std::vector<std::uint32_t>& numbers) {
  return std::accumulate(numbers.begin(), numbers.end(), std::uint64_t{0});
}

}  // namespace

Batch::Batch(State& state, const Call& call, AnswerForm form)
    : state_(state), call_(call), form_(form), record_(call.NewRecord()) {}

void Batch::Run(const v1::GatherRequest& request, std::function<void(const absl::Status&)> done) {
  Describe(request);
  if (!call_.admission().ok()) return done(call_.admission());
  state_.RunOnCpu(record_.bytes_in, [this, &request, done = std::move(done)] {
    if (auto status = Parse(request); !status.ok()) return done(status);
    const auto submitted =
        state_.device_queue.Submit([this] { return call_.Alive(); },
                                   [this, done](const absl::Status& turn, double queue_us) {
                                     record_.timings.set_queue_us(queue_us);
                                     if (!turn.ok()) return done(turn);
                                     const Stopwatch held;
                                     const auto status = call_.Explain(Gather());
                                     record_.device_us = held.microseconds();
                                     done(status);
                                   });
    if (!submitted.ok()) done(submitted);
  });
}

/// What the log tells of a batch, also of one that is refused.
void Batch::Describe(const v1::GatherRequest& request) {
  record_.map = request.map();
  record_.device = state_.device_name();
  record_.batch_id = request.batch_id();
  record_.queries = request.positions().size() / (3 * sizeof(float));
  record_.k = request.k();
  record_.radius = request.has_radius() ? request.radius() : std::numeric_limits<float>::infinity();
  record_.own_radii = !request.radii().empty();
  record_.bytes_in = request.ByteSizeLong();
}

absl::Status Batch::Parse(const v1::GatherRequest& request) {
  if (auto status = CheckName("map", request.map()); !status.ok()) return status;
  const auto map = state_.store.Find(request.map(), request.version());
  if (!map.ok()) return map.status();
  map_ = *map;
  record_.version = map_->version;
  record_.device = map_->gatherer->report().device;
  auto batch = ParseGather(request, *map_->gatherer, state_.options.limits);
  if (!batch.ok()) return batch.status();
  batch_ = *std::move(batch);
  const Limits& limits = state_.options.limits;
  if (form_ == AnswerForm::kMessage) {
    const auto status =
        CheckFitsMessage(batch_.options, batch_.size(), map_->gatherer->photon_count(), limits);
    if (!status.ok()) return status;
  }
  // Here for lists of k, before the batch waits for the device; lists without a cap are counted
  // there.
  batch_.options.max_neighbors = limits.max_neighbors;
  const bool lists = (batch_.options.outputs & kOutputNeighbors) != 0;
  return CheckNeighborCount(lists ? std::uint64_t{batch_.options.k} * batch_.size() : 0,
                            batch_.options);
}

absl::Status Batch::Gather() {
  auto result = map_->gatherer->Gather(batch_.queries(), batch_.options, call_.cancelled());
  if (!result.ok()) return result.status();
  result_ = *std::move(result);
  record_.timings.set_upload_us(result_.times.upload_us);
  record_.timings.set_kernel_us(result_.times.kernel_us);
  record_.timings.set_download_us(result_.times.download_us);
  if ((batch_.options.outputs & kOutputStatistics) != 0) {
    record_.nodes_visited = Sum(result_.nodes_visited);
    record_.distance_tests = Sum(result_.distance_tests);
  }
  return absl::OkStatus();
}

absl::Status Batch::WriteNext(v1::GatherResponse& response) {
  const Stopwatch watch;
  const auto last =
      form_ == AnswerForm::kMessage
          ? batch_.size()
          : FindPartEnd(result_, batch_.options, batch_.size(), next_query_, state_.options.limits);
  if (!last.ok()) return last.status();
  response.set_batch_id(*record_.batch_id);
  response.set_map(map_->name);
  response.set_version(map_->version);
  WritePart(result_, batch_.options, next_query_, *last, response);
  next_query_ = *last;
  v1::Timings& timings = record_.timings;
  timings.set_serialise_us(timings.serialise_us() + watch.microseconds());
  if (complete()) {
    timings.set_total_us(watch_.microseconds());
    response.set_last(true);
    *response.mutable_timings() = timings;
  }
  record_.bytes_out += response.ByteSizeLong();
  return absl::OkStatus();
}

std::size_t Batch::next_bytes() const {
  const std::uint64_t neighbors = result_.neighbor_ids.size();
  const std::uint64_t bytes =
      LargestAnswer(batch_.options, batch_.size(), 0) + (batch_.options.k == 0 ? 8 * neighbors : 0);
  return std::min<std::uint64_t>(bytes, state_.options.limits.max_part_bytes);
}

void Batch::Log(const absl::Status& status) {
  if (!complete() || !status.ok()) record_.timings.set_total_us(watch_.microseconds());
  state_.log->Write(record_, status);
}

}  // namespace treelight::server
