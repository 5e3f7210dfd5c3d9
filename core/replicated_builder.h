#ifndef TREELIGHT_CORE_REPLICATED_BUILDER_H_
#define TREELIGHT_CORE_REPLICATED_BUILDER_H_

#include <cstddef>
#include <memory>
#include <vector>

#include "core/builder.h"

namespace treelight {

/// Queries of a part of a batch that a device is given, at least: fewer do not fill a GPU.
inline constexpr std::size_t kFewestSplitQueries = 1 << 14;

/// A builder on several devices, equally fast: each map lies on all of them, and a batch is cut
/// into as many parts, in order, that are answered at once. The same trees, so the same answers, as
/// on one, bit for bit. Small batches, and lists without a cap, which are counted as a whole, go to
/// one device, the next in turn. An error on one device is that of the call. Reports tell of the
/// bytes on one device, the most that any holds, and of the stages on the slowest one; the times of
/// a gather are the longest of its parts.
/// @param devices  at least 1
std::unique_ptr<Builder> MakeReplicatedBuilder(std::vector<std::unique_ptr<Builder>> devices);

}  // namespace treelight

#endif  // TREELIGHT_CORE_REPLICATED_BUILDER_H_
