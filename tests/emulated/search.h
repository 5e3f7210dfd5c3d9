/* What the kernels are given that search the wide tree, and the calls of search.cl. Compiled by
 * both: a device passes arguments one by one. */
#ifndef TREELIGHT_TESTS_EMULATED_SEARCH_H_
#define TREELIGHT_TESTS_EMULATED_SEARCH_H_

#ifndef __OPENCL_C_VERSION__
#include "core/kernels/types.h"
#define global
#define local
namespace treelight::emulated {
#endif

/** Arguments by their names in gather_wide and gather_long; a kernel that lacks one ignores it. */
typedef struct SearchArguments {
  global const WideBox* boxes;
  WideTree wide;
  global const WideSizes* sizes;
  global const LeafPhoton* photons;
  global const PhotonPower* powers;
  global const float* positions;
  global const uint* order;
  global const float* radii_in;
  global const float* normals;
  GatherParams params;
  global uint* counts;
  global float* radii;
  global uint* neighbor_ids;
  global float* neighbor_d2;
  global float* densities;
  uint list_size;
  local ulong* all_lists;
} SearchArguments;

#ifndef __OPENCL_C_VERSION__
#undef global
#undef local
/** One work-item of a kernel; the number is QUERIES, of gather_long SUB_GROUPS. */
extern "C" {
void run_gather_wide_4(const SearchArguments*);
void run_gather_wide_1(const SearchArguments*);
void run_gather_long_1(const SearchArguments*);
void run_gather_long_2(const SearchArguments*);
void run_count_wide_8(const SearchArguments*);
void run_count_wide_2(const SearchArguments*);
void run_density_wide_4(const SearchArguments*);
void run_density_wide_1(const SearchArguments*);
}
}  // namespace treelight::emulated
#endif
#endif
