#ifndef TREELIGHT_CLIENT_LOAD_LATENCY_HISTOGRAM_H_
#define TREELIGHT_CLIENT_LOAD_LATENCY_HISTOGRAM_H_

#include <chrono>
#include <cstdint>
#include <vector>

namespace treelight::client {

/// Counts latencies in log-linear buckets, as HdrHistogram does: 128 of equal width for each power
/// of two of nanoseconds, so that a percentile is at most 1/128 too large. Not thread-safe.
class LatencyHistogram {
 public:
  /// Negative ones count as 0.
  void Record(std::chrono::nanoseconds latency);

  /// Adds what `other` has counted.
  void Add(const LatencyHistogram& other);

  /// The smallest limit of a bucket that at least `fraction`, [0, 1], of the latencies do not
  /// exceed, and never more than max(); 0 where there are none.
  std::chrono::nanoseconds Percentile(double fraction) const;

  std::uint64_t count() const { return count_; }
  std::chrono::nanoseconds max() const { return max_; }

 private:
  std::vector<std::uint64_t> counts_;  // by bucket; as long as the largest needs
  std::uint64_t count_ = 0;
  std::chrono::nanoseconds max_{};
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_LOAD_LATENCY_HISTOGRAM_H_
