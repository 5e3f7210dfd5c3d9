#include "client/scenes/json_text.h"

#include <algorithm>
#include <set>
#include <vector>

#include "absl/status/status.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr int kMaxDepth = 64;

absl::Status ErrorAt(std::string_view text, std::size_t byte, const std::string& path,
                     std::string_view error) {
  const std::string_view before = text.substr(0, byte);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const std::size_t column = byte - (before.find_last_of('\n') + 1);
  return absl::InvalidArgumentError(fmt::format("{}:{}:{}: {}", path, line, column, error));
}

/// What the library says is wrong, printable, without its own place:
/// "[json.exception.parse_error.101] parse error at line 1, column 2: what it is".
std::string Reason(const nlohmann::json::exception& error) {
  std::string_view what = error.what();
  if (const auto end = what.find("] "); end != what.npos) what.remove_prefix(end + 2);
  if (what.starts_with("parse error"))
    what.remove_prefix(std::min(what.find(": ") + 2, what.size()));
  std::string reason(what.substr(0, 200));
  for (char& c : reason) {
    if (c < ' ' || c > '~') c = '?';
  }
  return reason;
}

}  // namespace

absl::StatusOr<nlohmann::json> ParseJson(std::string_view text, const std::string& path) {
  using Json = nlohmann::json;
  bool too_deep = false;
  std::string repeated;
  std::vector<std::set<std::string>> keys;  // of the open objects and arrays
  const auto callback = [&](int depth, Json::parse_event_t event, Json& value) {
    if (depth > kMaxDepth) too_deep = true;
    if (event == Json::parse_event_t::object_start || event == Json::parse_event_t::array_start) {
      keys.emplace_back();
    } else if (event == Json::parse_event_t::object_end ||
               event == Json::parse_event_t::array_end) {
      if (!keys.empty()) keys.pop_back();
    } else if (event == Json::parse_event_t::key && !keys.empty()) {
      const std::string key = value.get<std::string>();
      if (!keys.back().insert(key).second && repeated.empty()) repeated = key;
    }
    return !too_deep;
  };
  try {
    Json json = Json::parse(text.begin(), text.end(), callback);
    if (too_deep)
      return absl::InvalidArgumentError(
          fmt::format("{}: JSON of more than {} levels", path, kMaxDepth));
    if (!repeated.empty())
      return absl::InvalidArgumentError(
          fmt::format("{}: key \"{}\" stands twice in an object", path, repeated.substr(0, 40)));
    return json;
  } catch (const Json::parse_error& error) {
    return ErrorAt(text, std::min(error.byte, text.size()), path, Reason(error));
  } catch (const Json::exception& error) {  // a number beyond double
    return absl::InvalidArgumentError(fmt::format("{}: {}", path, Reason(error)));
  }
}

}  // namespace treelight::client
