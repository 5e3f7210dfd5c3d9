#ifndef TREELIGHT_CORE_KEEP_MEMORY_H_
#define TREELIGHT_CORE_KEEP_MEMORY_H_

#include <cstdlib>  // defines __GLIBC__ where it is

#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace treelight {

/// Makes malloc use again what programs free all the time: messages of up to 4 MiB. Without it
/// glibc gives each back to the system, whose new pages then cost more than the bytes that travel
/// in them. At most 16 MiB of each arena stay free. For the beginning of main().
inline void KeepMessageMemory() {
#ifdef __GLIBC__
  constexpr int kLargestMessage = 4 << 20, kKept = 16 << 20;
  mallopt(M_MMAP_THRESHOLD, kLargestMessage);
  mallopt(M_TRIM_THRESHOLD, kKept);
#endif
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_KEEP_MEMORY_H_
