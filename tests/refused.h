#ifndef TREELIGHT_TESTS_REFUSED_H_
#define TREELIGHT_TESTS_REFUSED_H_

#include <limits>

#include "absl/status/status.h"
#include "gtest/gtest.h"

namespace treelight {

inline constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// Expects INVALID_ARGUMENT with this `message`.
inline void ExpectInvalidArgument(const absl::Status& status, const char* message) {
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status.message(), message);
}

}  // namespace treelight

#endif  // TREELIGHT_TESTS_REFUSED_H_
