#include "core/cpu/simd/lanes_plain.h"
#include "core/cpu/simd/packed_search_impl.h"

namespace treelight {

std::unique_ptr<PackedSearch> MakePlainSearch(const Tree& tree) {
  return std::make_unique<LaneSearch<PlainLanes>>(tree);
}

}  // namespace treelight
