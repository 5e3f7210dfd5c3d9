#ifndef TREELIGHT_TESTS_FUZZ_REQUIRE_H_
#define TREELIGHT_TESTS_FUZZ_REQUIRE_H_

#include <cstdio>
#include <cstdlib>
#include <string>

#include "absl/status/status.h"

namespace treelight::fuzz {

/// Ends the fuzzer, which keeps the input, where `holds` is false.
inline void Require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "not so: %s\n", what);
  std::abort();
}

/// A refusal has one of the codes that are meant for it, and says something.
inline void RequireRefusal(const absl::Status& status) {
  Require(!status.ok(), "a refusal is no OK");
  Require(!absl::IsInternal(status) && !absl::IsUnknown(status), "the fault is the input's");
  Require(!status.message().empty(), "a refusal says why");
}

}  // namespace treelight::fuzz

#endif  // TREELIGHT_TESTS_FUZZ_REQUIRE_H_
