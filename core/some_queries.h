#ifndef TREELIGHT_CORE_SOME_QUERIES_H_
#define TREELIGHT_CORE_SOME_QUERIES_H_

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/gatherer.h"

namespace treelight {

/// Some queries of a batch, with arrays of their own.
struct SomeQueries {
  std::vector<float> positions, normals, radii;

  /// @param chosen  indices of queries, in the order that they get
  SomeQueries(const GatherQueries& queries, std::span<const std::uint32_t> chosen) {
    for (const std::size_t query : chosen) {
      const auto append = [query](std::span<const float> from, std::size_t width,
                                  std::vector<float>& to) {
        if (!from.empty()) to.insert(to.end(), &from[width * query], &from[width * query] + width);
      };
      append(queries.positions, 3, positions);
      append(queries.normals, 3, normals);
      append(queries.radii, 1, radii);
    }
  }
  GatherQueries view() const {
    return {.positions = positions, .normals = normals, .radii = radii};
  }
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_SOME_QUERIES_H_
