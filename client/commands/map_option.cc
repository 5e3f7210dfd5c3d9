#include "client/commands/map_option.h"

#include <charconv>

#include "client/commands/check.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

MapRef ParseMapRef(const std::string& option, const std::string& text) {
  const std::size_t at = text.find('@');
  MapRef map{.name = text.substr(0, at)};
  if (const std::string error = ServerName()(map.name); !error.empty())
    throw CLI::ValidationError(option, error);
  if (at == text.npos) return map;
  const char *first = text.data() + at + 1, *last = text.data() + text.size();
  const auto [stop, error] = std::from_chars(first, last, map.version);
  if (error != std::errc() || stop != last || map.version == 0) {
    throw CLI::ValidationError(
        option,
        fmt::format("'{}' is neither NAME nor NAME@VERSION, a version being 1 or more", text));
  }
  return map;
}

}  // namespace

CLI::Option* AddMapOption(CLI::App& command, const std::string& name, MapRef& map) {
  return command
      .add_option_function<std::string>(
          name, [&map, name](const std::string& text) { map = ParseMapRef(name, text); },
          "Map: NAME for its newest version, or NAME@VERSION")
      ->type_name("NAME[@VERSION]");
}

}  // namespace treelight::client
