#ifndef TREELIGHT_CLIENT_RETRY_H_
#define TREELIGHT_CLIENT_RETRY_H_

#include <chrono>
#include <functional>
#include <optional>

#include "absl/status/status.h"

namespace treelight::client {

/// Whether the call did not reach a server, or was cut off with it: UNAVAILABLE, and what gRPC says
/// where a server ends, or a balancer resets a call, under way. The request may have been done.
bool IsBroken(const absl::Status& status);

/// Whether and when to repeat what the server had no room for, or what broke. Not thread-safe.
class RetryPolicy {
 public:
  /// Of a call that must end by `deadline`, time_point::max() for never; pauses end after
  /// `patience` together.
  RetryPolicy(std::chrono::system_clock::time_point deadline, std::chrono::milliseconds patience)
      : deadline_(deadline), left_(patience) {}

  /// The pause before the next attempt: the server's RetryInfo, doubled at each further refusal,
  /// and up to a quarter more, by chance, so that clients refused together do not come back
  /// together. Of a call that broke, for want of a server or with it, from 20 ms to 1.3 s, four
  /// times: enough for a balancer to take another server, and for one that ends to be gone. Empty:
  /// `status` is neither, or the pause would not end in time.
  std::optional<std::chrono::milliseconds> NextPause(const absl::Status& status);

 private:
  const std::chrono::system_clock::time_point deadline_;
  std::chrono::milliseconds left_;
  int refusal_count_ = 0, break_count_ = 0;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RETRY_H_
