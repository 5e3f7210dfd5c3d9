#include "core/cpu/simd/lanes_avx2.h"
#include "core/cpu/simd/packed_search_impl.h"

namespace treelight {

std::unique_ptr<PackedSearch> MakeAvx2Search(const Tree& tree) {
  return std::make_unique<LaneSearch<Avx2Lanes>>(tree);
}

}  // namespace treelight
