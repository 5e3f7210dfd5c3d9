/* What the kernel of ties_short.cl is given, and the call of ties_short.cl of this folder. Compiled
 * by both: a device passes arguments one by one. */
#ifndef TREELIGHT_TESTS_EMULATED_TIES_SHORT_H_
#define TREELIGHT_TESTS_EMULATED_TIES_SHORT_H_

#ifndef __OPENCL_C_VERSION__
#include "core/kernels/types.h"
#define global
namespace treelight::emulated {
using uchar = std::uint8_t;
#endif

/** Arguments by their names in tie_short_runs. */
typedef struct TiesArguments {
  global const float* positions;
  uint n;
  uint max_leaf_size;
  uint base;
  global uint* ids;
  global uchar* levels;
  global uint* rest;
} TiesArguments;

#ifndef __OPENCL_C_VERSION__
#undef global
extern "C" void run_tie_short_runs(const TiesArguments*); /**< one work-item */
}  // namespace treelight::emulated
#endif
#endif
