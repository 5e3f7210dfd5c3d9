/* What the kernels of wide_tree.cl are given, and the calls of wide_tree.cl of this folder.
 * Compiled by both: a device passes arguments one by one. */
#ifndef TREELIGHT_TESTS_EMULATED_WIDE_TREE_H_
#define TREELIGHT_TESTS_EMULATED_WIDE_TREE_H_

#ifndef __OPENCL_C_VERSION__
#include "core/kernels/types.h"
#define global
namespace treelight::emulated {
using uchar = std::uint8_t;
#endif

/** Arguments by their names in the kernels; a kernel that lacks one ignores it. */
typedef struct WideTreeArguments {
  global const uint* places;
  global const uint* firsts;
  uint leaf_count;
  global const uchar* levels;
  global const LeafPhoton* photons;
  global WideBox* boxes;
  WideTree tree;
  global uchar* meets;
  uint stride;
  global WideSizes* sizes;
  uint level;
  uint max_begins;
  global uint* counts;
} WideTreeArguments;

#ifndef __OPENCL_C_VERSION__
#undef global
/** One work-item of a kernel each. */
extern "C" {
void run_wide_block_firsts(const WideTreeArguments*);
void run_wide_blocks(const WideTreeArguments*);
void run_wide_counts(const WideTreeArguments*);
void run_wide_nodes(const WideTreeArguments*);
void run_wide_top(const WideTreeArguments*);
}
}  // namespace treelight::emulated
#endif
#endif
