#ifndef TREELIGHT_TESTS_EMULATED_WIDE_SEARCH_H_
#define TREELIGHT_TESTS_EMULATED_WIDE_SEARCH_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/gatherer.h"
#include "tests/emulated/search.h"
#include "tests/wide_reference.h"

namespace treelight::emulated {

/// A kernel of core/kernels that searches the wide tree, compiled for the host with -DQUERIES and
/// -DSUB_GROUPS.
struct Program {
  const char* name;
  void (*item)(const SearchArguments*);
  std::size_t queries;  ///< of a sub-group
  std::size_t sub_groups;
};

/// A map to search.
struct Map {
  Tree tree;
  reference::WideReference wide;
  std::vector<PhotonPower> powers;  ///< [n] in the order of photon index
};

/// The map that `gatherer` holds, which has at least one photon.
Map ReadMap(const Gatherer& gatherer);

/// Gathers as a device does with this kernel, in two launches, the queries in another order than
/// they are given in. Throws as RunWorkGroups, and where a list of `list_size` is overrun.
/// @param list_size  of gather_long
GatherResult Search(const Program& program, const Map& map, const GatherQueries& queries,
                    const GatherOptions& options, std::uint32_t list_size = 0);

}  // namespace treelight::emulated

#endif  // TREELIGHT_TESTS_EMULATED_WIDE_SEARCH_H_
