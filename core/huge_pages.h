#ifndef TREELIGHT_CORE_HUGE_PAGES_H_
#define TREELIGHT_CORE_HUGE_PAGES_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace treelight {

/// Asks the system for pages of 2 MiB where [data, data + bytes) is touched for the first time: a
/// page of 4 KiB costs more than what is written to it. Nothing where the array is small or the
/// system has no such pages.
inline void WantHugePages(void* data, std::size_t bytes) {
#ifdef MADV_HUGEPAGE
  constexpr std::uintptr_t kPage = 2 << 20;
  const auto begin = (reinterpret_cast<std::uintptr_t>(data) + kPage - 1) / kPage * kPage;
  const auto end = (reinterpret_cast<std::uintptr_t>(data) + bytes) / kPage * kPage;
  if (begin < end) madvise(reinterpret_cast<void*>(begin), end - begin, MADV_HUGEPAGE);
#else
  (void)data;
  (void)bytes;
#endif
}

/// Reserves room for `count` elements, in such pages where that is much.
template <typename T, typename Allocator>
void ReserveHuge(std::vector<T, Allocator>& vector, std::size_t count) {
  vector.reserve(count);
  WantHugePages(vector.data(), vector.capacity() * sizeof(T));
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_HUGE_PAGES_H_
