#ifndef TREELIGHT_CLIENT_RETRY_H_
#define TREELIGHT_CLIENT_RETRY_H_

#include <chrono>
#include <functional>
#include <optional>

#include "absl/status/status.h"

namespace treelight::client {

/// Whether and when to repeat what the server had no room for. Not thread-safe.
class RetryPolicy {
 public:
  /// Of a call that must end by `deadline`, time_point::max() for never; pauses end after
  /// `patience` together.
  RetryPolicy(std::chrono::system_clock::time_point deadline, std::chrono::milliseconds patience)
      : deadline_(deadline), left_(patience) {}

  /// The pause before the next attempt: the server's RetryInfo, doubled at each further refusal,
  /// and up to a quarter more, by chance, so that clients refused together do not come back
  /// together. Empty: `status` is no such refusal, or the pause would not end in time.
  std::optional<std::chrono::milliseconds> NextPause(const absl::Status& status);

 private:
  const std::chrono::system_clock::time_point deadline_;
  std::chrono::milliseconds left_;
  int refusal_count_ = 0;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RETRY_H_
