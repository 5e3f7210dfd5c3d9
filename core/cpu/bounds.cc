#include "core/cpu/bounds.h"

#include <cstddef>

#include "tbb/blocked_range.h"
#include "tbb/parallel_reduce.h"

namespace treelight {

Box BoundsOf(const std::vector<float>& positions) {
  return tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, positions.size() / 3, 1 << 14), Box{},
      [&](const auto& range, Box box) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          const float* const p = &positions[3 * i];
          box.Extend(Vec3{p[0] + 0.0f, p[1] + 0.0f, p[2] + 0.0f});
        }
        return box;
      },
      [](Box a, const Box& b) {
        a.Extend(b);
        return a;
      });
}

}  // namespace treelight
