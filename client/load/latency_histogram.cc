#include "client/load/latency_histogram.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace treelight::client {
namespace {

constexpr unsigned kLog2Buckets = 7;
constexpr std::uint64_t kBuckets = 1 << kLog2Buckets;  // of one power of two

// Numbers below 2 * kBuckets have a bucket each; those in [2^e, 2^(e+1)) share them by their
// highest kLog2Buckets + 1 bits.
std::size_t BucketOf(std::uint64_t ns) {
  if (ns < 2 * kBuckets) return ns;
  const unsigned shift = static_cast<unsigned>(std::bit_width(ns)) - kLog2Buckets - 1;
  return shift * kBuckets + (ns >> shift);
}

// The largest number of a bucket.
std::uint64_t LimitOf(std::size_t bucket) {
  if (bucket < 2 * kBuckets) return bucket;
  const std::size_t shift = bucket / kBuckets - 1;
  return ((bucket - shift * kBuckets + 1) << shift) - 1;
}

}  // namespace

void LatencyHistogram::Record(std::chrono::nanoseconds latency) {
  const auto ns = static_cast<std::uint64_t>(std::max<std::int64_t>(0, latency.count()));
  const std::size_t bucket = BucketOf(ns);
  if (bucket >= counts_.size()) counts_.resize(bucket + 1);
  ++counts_[bucket];
  ++count_;
  max_ = std::max(max_, latency);
}

void LatencyHistogram::Add(const LatencyHistogram& other) {
  counts_.resize(std::max(counts_.size(), other.counts_.size()));
  for (std::size_t i = 0; i < other.counts_.size(); ++i) counts_[i] += other.counts_[i];
  count_ += other.count_;
  max_ = std::max(max_, other.max_);
}

std::chrono::nanoseconds LatencyHistogram::Percentile(double fraction) const {
  const auto rank = std::max<std::uint64_t>(
      1, static_cast<std::uint64_t>(std::ceil(fraction * static_cast<double>(count_))));
  std::uint64_t seen = 0;
  for (std::size_t bucket = 0; bucket < counts_.size(); ++bucket) {
    seen += counts_[bucket];
    if (seen >= rank) {
      return std::min(max_, std::chrono::nanoseconds(static_cast<std::int64_t>(LimitOf(bucket))));
    }
  }
  return max_;
}

}  // namespace treelight::client
