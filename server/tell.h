#ifndef TREELIGHT_SERVER_TELL_H_
#define TREELIGHT_SERVER_TELL_H_

#include <cstdio>
#include <string>
#include <string_view>

#include "fmt/format.h"

namespace treelight::server {

/// Writes the line "treelightd: `text`" to stderr. Where stderr takes nothing, for want of disk
/// say, nobody is told, and the server goes on: fmt::print throws there.
inline void Tell(std::string_view text) {
  const std::string line = fmt::format("treelightd: {}\n", text);
  std::fwrite(line.data(), 1, line.size(), stderr);
}

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_TELL_H_
