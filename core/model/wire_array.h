#ifndef TREELIGHT_CORE_MODEL_WIRE_ARRAY_H_
#define TREELIGHT_CORE_MODEL_WIRE_ARRAY_H_

#include <bit>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

// Arrays on the wire are `bytes` of little-endian numbers (photon_map.proto), as this machine keeps
// them.
namespace treelight {

static_assert(std::endian::native == std::endian::little);

/// Numbers of a `bytes` field, appended to `array`. `bytes` holds whole numbers, the caller has
/// checked.
template <typename T>
void AppendFromWire(const std::string& bytes, std::vector<T>& array) {
  static_assert(std::is_arithmetic_v<T>);
  // A string's characters are aligned as its pointers are. Appended, so that they are written once.
  const T* numbers = reinterpret_cast<const T*>(bytes.data());
  array.insert(array.end(), numbers, numbers + bytes.size() / sizeof(T));
}

/// The `bytes` field of `array`.
template <typename T>
std::string WireBytes(std::span<const T> array) {
  static_assert(std::is_arithmetic_v<T>);
  return {reinterpret_cast<const char*>(array.data()), array.size_bytes()};
}

}  // namespace treelight

#endif  // TREELIGHT_CORE_MODEL_WIRE_ARRAY_H_
