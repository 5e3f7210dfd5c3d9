#include "client/render/map_gather.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "client/render/stopwatch.h"

namespace treelight::client {
namespace {

constexpr std::uint64_t kNoSample = std::numeric_limits<std::uint64_t>::max();

/// Runs `work` and adds the seconds that it took to `seconds`.
template <typename Work>
auto Timed(double& seconds, Work work) {
  const Stopwatch begin;
  auto result = work();
  seconds += begin.Seconds();
  return result;
}

}  // namespace

MapGather::MapGather(PhotonMapClient& client, const MapRef& map, const EstimateOptions& estimate,
                     std::size_t max_queries, Sink sink)
    : pipeline_(client, map,
                {.k = estimate.k,
                 .radius = estimate.radius,
                 .outputs = kOutputDensity,
                 .kernel = estimate.kernel,
                 .approximation = estimate.approximation}),
      max_queries_(max_queries),
      sink_(std::move(sink)),
      message_size_(std::min(kFirstMessage, max_queries)),
      filling_{.samples = {}, .weights = {}, .first_sample = kNoSample} {}

absl::Status MapGather::Add(const GatherPoints& points, std::uint64_t first_sample) {
  for (std::size_t first = 0; first < points.size();) {
    const std::size_t count =
        std::min(message_size_ - filling_.samples.size(), points.size() - first);
    positions_.insert(positions_.end(), points.positions.begin() + 3 * first,
                      points.positions.begin() + 3 * (first + count));
    normals_.insert(normals_.end(), points.normals.begin() + 3 * first,
                    points.normals.begin() + 3 * (first + count));
    filling_.weights.insert(filling_.weights.end(), points.weights.begin() + first,
                            points.weights.begin() + first + count);
    for (std::size_t i = first; i < first + count; ++i) {
      const std::uint64_t sample = first_sample + points.samples[i];
      filling_.samples.push_back(sample);
      filling_.first_sample = std::min(filling_.first_sample, sample);
      if (cost_.queries++ % kSampleStride == 0) {
        cost_.sample.insert(cost_.sample.end(), points.positions.begin() + 3 * i,
                            points.positions.begin() + 3 * i + 3);
      }
    }
    first += count;
    if (filling_.samples.size() == message_size_) {
      if (const auto status = Send(); !status.ok()) return status;
    }
  }
  return absl::OkStatus();
}

absl::Status MapGather::Send() {
  if (in_flight_.size() == kMaxInFlight) {
    if (const auto status = Receive(); !status.ok()) return status;
  }
  const auto status = Timed(cost_.wait_s, [&] {
    return pipeline_.Send({.positions = positions_, .normals = normals_, .radii = {}});
  });
  if (!status.ok()) return status;
  ++cost_.messages;
  in_flight_.push_back(
      std::exchange(filling_, {.samples = {}, .weights = {}, .first_sample = kNoSample}));
  positions_.clear();
  normals_.clear();
  message_size_ = std::min(2 * message_size_, max_queries_);
  return absl::OkStatus();
}

absl::Status MapGather::Receive() {
  const auto answer = Timed(cost_.wait_s, [&] { return pipeline_.Receive(); });
  if (!answer.ok()) return answer.status();
  cost_.kernel_us += answer->timings.kernel_us();
  cost_.transfer_us += answer->timings.upload_us() + answer->timings.download_us();
  if (answer->merge_report.merged_photons() > 0) {
    cost_.merged += answer->errors.inexact_count;
    cost_.merged_error =
        std::max<double>(cost_.merged_error, answer->merge_report.measured_error());
  }
  const std::vector<float>& densities = answer->result.densities;
  const Message& message = in_flight_.front();
  for (std::size_t i = 0; i < message.samples.size(); ++i) {
    sink_(message.samples[i],
          message.weights[i] * Rgb{densities[3 * i], densities[3 * i + 1], densities[3 * i + 2]});
  }
  in_flight_.pop_front();
  return absl::OkStatus();
}

absl::Status MapGather::Flush() { return filling_.samples.empty() ? absl::OkStatus() : Send(); }

absl::StatusOr<bool> MapGather::Finish() {
  if (in_flight_.empty()) return false;
  if (auto status = Receive(); !status.ok()) return status;
  return true;
}

std::uint64_t MapGather::answered_until() const {
  std::uint64_t first = filling_.first_sample;
  for (const Message& message : in_flight_) first = std::min(first, message.first_sample);
  return first;
}

}  // namespace treelight::client
