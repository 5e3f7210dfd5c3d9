#ifndef TREELIGHT_CORE_CPU_TREE_GATHERER_H_
#define TREELIGHT_CORE_CPU_TREE_GATHERER_H_

#include <memory>

#include "core/cpu/simd/packed_search.h"
#include "core/gatherer.h"

namespace treelight {

/// Answers gathers by searching `tree` on the CPU, by TBB in the arena of the caller.
/// @param photons       what the tree was built over
/// @param report        its `tree` is computed here, and the stage "pack" added
/// @param instructions  vector instructions that this processor has
std::unique_ptr<Gatherer> MakeTreeGatherer(
    Photons photons, Tree tree, BuildReport report,
    Instructions instructions = SupportedInstructions().back());

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_TREE_GATHERER_H_
