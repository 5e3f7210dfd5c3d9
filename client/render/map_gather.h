#ifndef TREELIGHT_CLIENT_RENDER_MAP_GATHER_H_
#define TREELIGHT_CLIENT_RENDER_MAP_GATHER_H_

#include <cstdint>
#include <deque>
#include <functional>
#include <vector>

#include "absl/status/status.h"
#include "client/photon_map_client.h"
#include "client/render/camera_pass.h"

namespace treelight::client {

/// Density estimate from one map: the k nearest photons within a radius.
struct EstimateOptions {
  std::uint32_t k = 0;  ///< 0: all within the radius
  float radius = 0;     ///< scene units, > 0, finite
  DensityKernel kernel = DensityKernel::kEpanechnikov;
  Approximation approximation{};
};

/// One query in so many is in GatherCost::sample.
inline constexpr std::size_t kSampleStride = 64;

/// What gathers from one map cost.
struct GatherCost {
  std::uint64_t queries = 0, messages = 0;
  double kernel_us = 0;         ///< on the server's device
  double transfer_us = 0;       ///< to the device and back
  double wait_s = 0;            ///< that the caller waited for the server
  std::uint64_t merged = 0;     ///< queries that were answered from merged photons
  double merged_error = 0;      ///< that the server measured of them, of the worst message
  std::vector<float> sample{};  ///< [3n] positions of every kSampleStride-th query
};

/// The gathers of one map. Queries are collected to messages as large as the server takes, since a
/// GPU is busy only with a large one; the first ones are smaller, so that it has work early. Up to
/// kMaxInFlight messages are on their way while the caller makes the next. Not thread-safe.
class MapGather {
 public:
  static constexpr std::size_t kMaxInFlight = 3;
  static constexpr std::size_t kFirstMessage = 8192;  ///< queries; each message is twice the last

  /// Takes the answer to a query: of which sample, and the radiance added to it.
  using Sink = std::function<void(std::uint64_t sample, const Rgb& radiance)>;

  /// `client` must outlive it. `max_queries`: in one message, > 0.
  MapGather(PhotonMapClient& client, const MapRef& map, const EstimateOptions& estimate,
            std::size_t max_queries, Sink sink);

  /// Adds queries; `first_sample` is that of their batch. Sends what fills a message, and takes the
  /// oldest answer where kMaxInFlight messages are on their way. The errors of GatherPipeline.
  absl::Status Add(const GatherPoints& points, std::uint64_t first_sample);

  /// Sends what does not fill a message.
  absl::Status Flush();

  /// Takes the oldest answer, after Flush. False: all are here.
  absl::StatusOr<bool> Finish();

  /// All queries of samples before it are answered.
  std::uint64_t answered_until() const;

  const GatherCost& cost() const { return cost_; }

 private:
  /// What is to be done with the answers to a message.
  struct Message {
    std::vector<std::uint64_t> samples;
    std::vector<Rgb> weights;
    std::uint64_t first_sample;  // smallest of `samples`
  };

  absl::Status Send();
  absl::Status Receive();

  GatherPipeline pipeline_;
  const std::size_t max_queries_;
  const Sink sink_;
  std::size_t message_size_;                // of the message that is being filled
  std::vector<float> positions_, normals_;  // of the message that is being filled
  Message filling_;
  std::deque<Message> in_flight_;
  GatherCost cost_;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_MAP_GATHER_H_
