/* What the kernels of radix_sort_onesweep.cl are given, and the calls of radix_sort.cl of this
 * folder. Compiled by both: a device passes arguments one by one. */
#ifndef TREELIGHT_TESTS_EMULATED_RADIX_SORT_H_
#define TREELIGHT_TESTS_EMULATED_RADIX_SORT_H_

#ifndef __OPENCL_C_VERSION__
#include "core/kernels/types.h"
#define global
namespace treelight::emulated {
#endif

/** Arguments by their names in sweep_pass; sweep_count takes `sweep` as its bins. */
typedef struct RadixSortArguments {
  global const void* keys; /**< of KEY_BITS each */
  global const uint* values;
  uint n;
  uint pass_count;
  uint shift;
  global const int* found;
  int most;
  global uint* sweep;
  uint bins_at;
  uint tiles_at;
  uint states_at;
  global void* keys_out;
  global uint* values_out;
} RadixSortArguments;

#ifndef __OPENCL_C_VERSION__
#undef global
/** One work-item of a kernel each; the number is KEY_BITS. */
extern "C" {
void run_sweep_count_32(const RadixSortArguments*);
void run_sweep_pass_32(const RadixSortArguments*);
void run_sweep_count_64(const RadixSortArguments*);
void run_sweep_pass_64(const RadixSortArguments*);
}
}  // namespace treelight::emulated
#endif
#endif
