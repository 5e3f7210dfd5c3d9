#include "core/cpu/simd/lanes_avx512.h"
#include "core/cpu/simd/packed_search_impl.h"

namespace treelight {

std::unique_ptr<PackedSearch> MakeAvx512Search(const Tree& tree) {
  return std::make_unique<LaneSearch<Avx512Lanes>>(tree);
}

}  // namespace treelight
