#ifndef TREELIGHT_CLIENT_LOAD_LOAD_RUN_H_
#define TREELIGHT_CLIENT_LOAD_LOAD_RUN_H_

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/load/latency_histogram.h"
#include "client/photon_map_client.h"

namespace treelight::client {

/// When requests are sent.
enum class Arrivals {
  kClosed,    ///< each worker sends the next once it has the answer to the last
  kConstant,  ///< at equal distances, whatever is answered
  kPoisson,   ///< at exponentially distributed distances, whatever is answered
};

enum class RequestKind { kGather, kBuild };
inline constexpr std::size_t kRequestKindCount = 2;

/// What to send.
struct LoadOptions {
  Arrivals arrivals = Arrivals::kClosed;
  double rate = 0;  ///< requests/s of kConstant and kPoisson, > 0
  std::chrono::milliseconds duration{10'000};
  std::uint32_t workers = 8;             ///< requests that may be under way, at least 1
  double build_share = 0;                ///< of the requests that are builds, [0, 1]
  std::uint64_t build_photons = 10'000;  ///< of one build, which is deleted by its time to live
  std::uint64_t queries = 1'000;         ///< of one gather
  GatherOptions gather{.k = 50, .radius = 0.1f, .outputs = kOutputCount | kOutputRadius};
  std::uint32_t seed = 1;
  /// Asked before each send, from several threads at once: whether to send nothing more. Empty: no.
  std::function<bool()> interrupted{};
};

/// What became of the requests of one kind.
struct KindResult {
  std::uint64_t sent = 0, ok = 0;
  std::uint64_t refused = 0;  ///< RESOURCE_EXHAUSTED
  std::uint64_t failed = 0;   ///< any other error
  absl::Status first_failure;
  /// Of those that are OK, from the moment they were meant to be sent.
  LatencyHistogram latency;
};

struct LoadResult {
  std::array<KindResult, kRequestKindCount> kinds;  ///< by RequestKind
  double seconds = 0;                               ///< until the last answer
  bool interrupted = false;                         ///< by LoadOptions::interrupted
  /// Sent more than 1 ms after the moment they were meant to be, since all workers waited for
  /// answers or this machine was too busy: 0 for kClosed, where nothing is meant.
  std::uint64_t late = 0;

  std::uint64_t sent() const;
  /// Whether the `fraction` that the latencies do not exceed, 0.99 say, says something: at most the
  /// rest of the sends were late, 1 %. Latencies count from the intended moment, so that none is
  /// left out; but a tail made of waiting for workers is that of this tool.
  bool IsSound(double fraction) const;
};

/// Sends gathers around random points of the unit cube to `map`, and builds, for
/// LoadOptions::duration, and waits for the answers. Each send that was meant to be is made, also
/// when late.
LoadResult RunLoad(PhotonMapClient& client, const MapRef& map, const LoadOptions& options);

/// `count` photons, uniform in the unit cube, with powers.
Photons MakeLoadPhotons(std::uint64_t count, std::uint32_t seed);

/// "gather", "build".
std::string KindName(RequestKind kind);

/// The moments at which requests are meant to be sent, from the beginning, drawn as they are asked
/// for. Not thread-safe.
class IntendedTimes {
 public:
  explicit IntendedTimes(const LoadOptions& options);

  /// The next one; none after LoadOptions::duration, and of kClosed.
  std::optional<std::chrono::nanoseconds> Next();

 private:
  const bool poisson_;
  const double rate_, end_;  // 1/s; s
  std::mt19937_64 engine_;
  std::exponential_distribution<double> distance_;
  std::uint64_t count_ = 0;  // that were asked for
  double seconds_ = 0;       // of the last one, of kPoisson
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_LOAD_LOAD_RUN_H_
