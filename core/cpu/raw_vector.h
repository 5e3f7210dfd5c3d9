#ifndef TREELIGHT_CORE_CPU_RAW_VECTOR_H_
#define TREELIGHT_CORE_CPU_RAW_VECTOR_H_

#include <cstddef>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/huge_pages.h"

namespace treelight {

/// Leaves what resize() adds as the memory is, so that pages nobody writes to are never touched,
/// and asks for large pages.
template <typename T>
struct RawAllocator : std::allocator<T> {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);
  template <typename U>
  struct rebind {
    using other = RawAllocator<U>;
  };

  T* allocate(std::size_t count) {
    T* const memory = std::allocator<T>::allocate(count);
    WantHugePages(memory, count * sizeof(T));
    return memory;
  }

  template <typename U>
  void construct(U*) noexcept {}
  template <typename U, typename... Arguments>
  void construct(U* at, Arguments&&... arguments) {
    std::construct_at(at, std::forward<Arguments>(arguments)...);
  }
};

/// A vector of plain values, undefined until they are written.
template <typename T>
using RawVector = std::vector<T, RawAllocator<T>>;

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_RAW_VECTOR_H_
