#ifndef TREELIGHT_SERVER_BREAK_SWITCH_H_
#define TREELIGHT_SERVER_BREAK_SWITCH_H_

#include <cstdlib>
#include <string_view>

namespace treelight::server {

/// Whether a promise is broken on purpose, to see that tests/faults notices: the one that the
/// environment's TREELIGHT_BREAK names. Only where the tests compile the sources so; never in
/// treelightd.
#ifdef TREELIGHT_BREAK_SWITCHES
inline bool Broken(std::string_view promise) {
  static const char* const broken = std::getenv("TREELIGHT_BREAK");
  return broken != nullptr && promise == broken;
}
#else
constexpr bool Broken(std::string_view) { return false; }
#endif

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_BREAK_SWITCH_H_
