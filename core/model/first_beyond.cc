#include "core/model/first_beyond.h"

#include <algorithm>
#include <cmath>

namespace treelight {

std::size_t FirstBeyond(std::span<const float> numbers, float limit) {
  constexpr std::size_t kBlock = 4096;
  const auto is_beyond = [limit](float number) { return !(std::fabs(number) <= limit); };
  for (std::size_t first = 0; first < numbers.size(); first += kBlock) {
    const auto block = numbers.subspan(first, std::min(kBlock, numbers.size() - first));
    // No way out of the loop: it becomes vector instructions.
    unsigned beyond = 0;
    for (const float number : block) beyond |= is_beyond(number) ? 1u : 0u;
    if (beyond == 0) continue;
    const auto found = std::ranges::find_if(block, is_beyond);
    return first + static_cast<std::size_t>(found - block.begin());
  }
  return numbers.size();
}

}  // namespace treelight
