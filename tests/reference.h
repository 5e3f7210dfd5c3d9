#ifndef TREELIGHT_TESTS_REFERENCE_H_
#define TREELIGHT_TESTS_REFERENCE_H_

#include <cstdint>
#include <vector>

#include "core/kernels/types.h"
#include "core/model/box.h"
#include "core/model/tree.h"

// Every stage of the build again, slow and plain, in float32 as the kernels; they share types.h
// with the kernels and nothing else.
namespace treelight::reference {

/// Box of the points [3n].
Box Bounds(const std::vector<float>& positions);

/// Code of every point, `bits_per_axis` bits per axis interleaved bit by bit, x highest.
std::vector<std::uint64_t> MortonCodes(const std::vector<float>& positions, const MortonGrid& grid,
                                       int bits_per_axis);

/// Photon indices in the order of (code, index).
std::vector<std::uint32_t> SortedIds(const std::vector<std::uint64_t>& codes);

/// Level of each boundary of ascending `code_bits`-bit codes, bit by bit.
std::vector<std::uint8_t> SplitLevels(const std::vector<std::uint64_t>& sorted_codes,
                                      int code_bits);

/// Rebuilds runs of kLevelTied longer than `max_leaf_size`, by recursion over the runs.
void BreakTies(const std::vector<float>& positions, int code_bits, std::uint32_t max_leaf_size,
               std::vector<std::uint32_t>& ids, std::vector<std::uint8_t>& levels);

/// First photon of each leaf, then n: recursion from the root over the smallest level of a range.
std::vector<std::uint32_t> LeafFirsts(const std::vector<std::uint8_t>& levels, std::size_t count,
                                      std::uint32_t max_leaf_size);

/// The tree over the leaves, top-down.
Tree Hierarchy(const std::vector<std::uint8_t>& levels,
               const std::vector<std::uint32_t>& leaf_firsts,
               const std::vector<LeafPhoton>& photons, std::uint32_t max_leaf_size);

}  // namespace treelight::reference

#endif  // TREELIGHT_TESTS_REFERENCE_H_
