#ifndef TREELIGHT_SERVER_WARM_UP_H_
#define TREELIGHT_SERVER_WARM_UP_H_

#include "absl/status/status.h"
#include "core/builder.h"

namespace treelight::server {

/// Runs every kernel of `builder` once on a small map, so that no request waits for a driver that
/// compiles a kernel at its first launch: with PoCL that is 0.2 to 0.9 s each, kept on disk for the
/// next start. Returns the first error.
absl::Status WarmUp(Builder& builder);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_WARM_UP_H_
