#include "client/commands/check.h"

#include <charconv>
#include <cstdint>
#include <limits>
#include <string>

#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr char kNameCharacters[] =
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-";
constexpr std::size_t kMaxNameLength = 128;  // photon_map.proto

CLI::Validator Check(std::function<std::string(const std::string&)> error) {
  return CLI::Validator([error](std::string& text) { return error(text); }, "");
}

}  // namespace

CLI::Validator NumberIn(double min, double max) {
  return Check([min, max](const std::string& text) {
    double value = 0;
    if (CLI::detail::lexical_cast(text, value) && value >= min && value <= max)
      return std::string();
    return fmt::format("'{}' is no number in [{}, {}]", text, min, max);
  });
}

CLI::Validator WithoutSign() {
  return Check([](const std::string& text) {
    if (text.find_first_of("+-") != text.npos) return fmt::format("'{}' has a sign", text);
    std::uint64_t value = 0;
    const auto error = std::from_chars(text.data(), text.data() + text.size(), value).ec;
    return error == std::errc::result_out_of_range
               ? fmt::format("'{}' is more than {}", text,
                             std::numeric_limits<std::uint64_t>::max())
               : std::string();
  });
}

CLI::Validator ServerName() {
  return Check([](const std::string& text) {
    return !text.empty() && text.size() <= kMaxNameLength &&
                   text.find_first_not_of(kNameCharacters) == text.npos
               ? std::string()
               : fmt::format("'{}' is no name: 1 to {} characters of A-Z a-z 0-9 . _ -", text,
                             kMaxNameLength);
  });
}

}  // namespace treelight::client
