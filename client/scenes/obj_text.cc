#include "client/scenes/obj_text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <optional>
#include <set>

#include "absl/status/status.h"
#include "client/scenes/mesh_file.h"
#include "core/model/photons.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

// Corners of a face: Assimp takes a time that grows with their square, a second for 16,000.
constexpr std::uint64_t kMaxCorners = 10'000;

constexpr std::string_view kBlanks = " \t\r\v\f";

// Statements of OBJ that are passed on, or over, unread (Wavefront, "Object Files (.obj)").
constexpr std::array<std::string_view, 43> kOtherStatements = {
    "vp",     "cstype", "deg",    "bmat",       "step",      "p",     "l",        "curv",
    "curv2",  "surf",   "parm",   "trim",       "hole",      "scrv",  "sp",       "end",
    "con",    "g",      "s",      "mg",         "o",         "bevel", "c_interp", "d_interp",
    "lod",    "maplib", "usemap", "shadow_obj", "trace_obj", "ctech", "stech",    "call",
    "csh",    "bsp",    "bzp",    "cdc",        "cdp",       "res",   "vt",       "vn",
    "usemtl", "mtllib", "xyzrgb"};

/// Takes the next word off `line`; empty at its end.
std::string_view TakeWord(std::string_view& line) {
  line.remove_prefix(std::min(line.find_first_not_of(kBlanks), line.size()));
  const std::string_view word = line.substr(0, line.find_first_of(kBlanks));
  line.remove_prefix(word.size());
  return word;
}

std::string_view Trim(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
  return text.substr(0, text.find_last_not_of(kBlanks) + 1);
}

/// `text` as it may stand in a message: not too long, printable.
std::string Quote(std::string_view text) {
  std::string quoted(text.substr(0, 40));
  for (char& c : quoted) {
    if (c < ' ' || c > '~') c = '?';
  }
  return "'" + quoted + "'";
}

template <typename T>
std::optional<T> ParseNumber(std::string_view word) {
  if (word.starts_with('+') && !word.starts_with("+-")) word.remove_prefix(1);
  T value{};
  const auto [stop, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc() || stop != word.data() + word.size()) return std::nullopt;
  return value;
}

/// Gives the statements of a text, one at a time, whole and without comments.
class Statements {
 public:
  explicit Statements(std::string_view text) : text_(text) {}

  /// The next statement that is not empty; it is valid until the next call. Nothing: the end.
  std::optional<std::string_view> Next() {
    while (!text_.empty()) {
      line_ = ++last_line_;
      std::string_view statement = TakeLine();
      if (statement.ends_with('\\')) {
        joined_.clear();
        while (statement.ends_with('\\') && !text_.empty()) {
          joined_.append(statement.substr(0, statement.size() - 1)).append(" ");
          ++last_line_;
          statement = TakeLine();
        }
        statement = joined_.append(statement);
      }
      statement = Trim(statement);
      if (!statement.empty()) return statement;
    }
    return std::nullopt;
  }

  std::uint64_t line() const { return line_; }  ///< in which the last statement begins, from 1

 private:
  std::string_view TakeLine() {
    const std::size_t end = std::min(text_.find('\n'), text_.size());
    std::string_view line = text_.substr(0, end);
    text_.remove_prefix(std::min(end + 1, text_.size()));
    if (std::string_view rest = line; !IsNaming(TakeWord(rest))) {
      line = line.substr(0, line.find('#'));
    }
    return line.substr(0, line.find_last_not_of(kBlanks) + 1);
  }

  /// Whether the rest of the line is a name, which may have a '#': 3ds Max makes "Material #25".
  static bool IsNaming(std::string_view keyword) {
    return keyword == "usemtl" || keyword == "newmtl" || keyword == "mtllib" || keyword == "g" ||
           keyword == "o";
  }

  std::string_view text_;
  std::string joined_;
  std::uint64_t line_ = 0, last_line_ = 0;
};

/// What has been seen of a file, and what it has told of itself.
struct ObjState {
  std::uint64_t vertex_count = 0, texture_count = 0, normal_count = 0;
  // The largest index of each kind in a face so far and the line that has it: a vertex may follow
  // the faces that use it.
  struct Largest {
    std::uint64_t index = 0, line = 0;
  };
  std::array<Largest, 3> largest;
  std::uint64_t corner_count = 0;  // of the last face
};

constexpr double kMaxFloat = std::numeric_limits<float>::max();

/// Checks that `rest` has `min` to `max` numbers within [lowest, largest]. An answer that is not
/// empty says what is wrong.
std::string CheckNumbers(std::string_view rest, int min, int max, double lowest, double largest) {
  int count = 0;
  for (std::string_view word = TakeWord(rest); !word.empty(); word = TakeWord(rest)) {
    const auto value = ParseNumber<double>(word);
    if (!value) return fmt::format("{} is no number", Quote(word));
    if (!(*value >= lowest && *value <= largest)) {
      return fmt::format("{} is not within [{:g}, {:g}]", Quote(word), lowest, largest);
    }
    ++count;
  }
  if (count >= min && count <= max) return {};
  return min == max ? fmt::format("{} numbers, expected {}", count, min)
                    : fmt::format("{} numbers, expected {} to {}", count, min, max);
}

std::string CheckVertex(std::string_view rest) {
  // x y z, with a weight or a colour behind.
  if (auto error = CheckNumbers(rest, 3, 7, -kMaxCoordinate, kMaxCoordinate); !error.empty())
    return error;
  std::array<std::string_view, 5> words;
  for (auto& word : words) word = TakeWord(rest);
  if (words[4].empty() && !words[3].empty()) {
    const double weight = *ParseNumber<double>(words[3]);
    for (int i = 0; i < 3; ++i) {
      if (!(std::fabs(*ParseNumber<double>(words[i]) / weight) <= kMaxCoordinate))
        return fmt::format("weight {} makes it infinite", Quote(words[3]));
    }
  }
  return {};
}

/// One corner of a face: v, v/vt, v//vn or v/vt/vn.
std::string CheckCorner(std::string_view corner, std::uint64_t line, ObjState& state) {
  static constexpr std::array<std::string_view, 3> kKinds = {"vertex", "texture coordinate",
                                                             "normal"};
  const std::array<std::uint64_t, 3> counts = {state.vertex_count, state.texture_count,
                                               state.normal_count};
  for (std::size_t kind = 0; kind < 4; ++kind) {
    if (kind == 3) return fmt::format("{} has more than two slashes", Quote(corner));
    const std::size_t slash = corner.find('/');
    const std::string_view part = corner.substr(0, slash);
    if (!part.empty() || kind == 0) {
      const auto index = ParseNumber<std::int64_t>(part);
      if (!index) return fmt::format("{} is no index of a {}", Quote(part), kKinds[kind]);
      if (*index == 0) return fmt::format("{} 0: they are counted from 1", kKinds[kind]);
      if (*index < 0 && static_cast<std::uint64_t>(-(*index + 1)) >= counts[kind]) {
        return fmt::format("{} {}: there are {} so far", kKinds[kind], *index, counts[kind]);
      }
      if (*index > 0 && static_cast<std::uint64_t>(*index) > state.largest[kind].index) {
        state.largest[kind] = {static_cast<std::uint64_t>(*index), line};
      }
    }
    if (slash == corner.npos) break;
    corner.remove_prefix(slash + 1);
  }
  return {};
}

std::string CheckFace(std::string_view rest, std::uint64_t line, ObjState& state) {
  state.corner_count = 0;
  for (std::string_view word = TakeWord(rest); !word.empty(); word = TakeWord(rest)) {
    if (auto error = CheckCorner(word, line, state); !error.empty()) return error;
    ++state.corner_count;
  }
  if (state.corner_count >= 3 && state.corner_count <= kMaxCorners) return {};
  return fmt::format("a face of {} corners, it must have 3 to {}", state.corner_count, kMaxCorners);
}

std::string CheckStatement(std::string_view keyword, std::string_view rest, std::uint64_t line,
                           ObjState& state) {
  if (keyword == "v") {
    ++state.vertex_count;
    return CheckVertex(rest);
  }
  if (keyword == "vn") {
    ++state.normal_count;
    return CheckNumbers(rest, 3, 3, -kMaxFloat, kMaxFloat);
  }
  if (keyword == "vt") {
    ++state.texture_count;
    return CheckNumbers(rest, 1, 3, -kMaxFloat, kMaxFloat);
  }
  if (keyword == "f" || keyword == "fo") return CheckFace(rest, line, state);
  if (std::find(kOtherStatements.begin(), kOtherStatements.end(), keyword) !=
      kOtherStatements.end()) {
    return {};
  }
  return fmt::format("{} is no statement of an OBJ file", Quote(keyword));
}

absl::Status ErrorAt(const std::string& path, std::uint64_t line, std::string_view error) {
  return absl::InvalidArgumentError(fmt::format("{}:{}: {}", path, line, error));
}

}  // namespace

absl::StatusOr<ObjText> CheckObj(std::string_view text, const std::string& path) {
  ObjText checked;
  checked.text.reserve(text.size() + 1);
  ObjState state;
  std::set<std::string, std::less<>> materials;
  Statements statements(text);
  while (const auto statement = statements.Next()) {
    std::string_view rest = *statement;
    const std::string_view keyword = TakeWord(rest);
    if (const auto error = CheckStatement(keyword, rest, statements.line(), state);
        !error.empty()) {
      return ErrorAt(path, statements.line(), error);
    }
    const std::string name(Trim(rest));
    if (keyword == "f" || keyword == "fo") checked.triangle_count += state.corner_count - 2;
    if (keyword == "mtllib") checked.libraries.emplace_back(statements.line(), name);
    if (keyword == "usemtl" && materials.insert(name).second)
      checked.materials.emplace_back(statements.line(), name);
    checked.text.append(*statement).push_back('\n');
  }
  // Faces may name vertices that follow them.
  const std::array<std::pair<std::string_view, std::uint64_t>, 3> kinds = {
      {{"vertex", state.vertex_count},
       {"texture coordinate", state.texture_count},
       {"normal", state.normal_count}}};
  for (std::size_t kind = 0; kind < kinds.size(); ++kind) {
    const auto& [index, line] = state.largest[kind];
    if (index > kinds[kind].second) {
      return ErrorAt(
          path, line,
          fmt::format("{} {}: the file has {}", kinds[kind].first, index, kinds[kind].second));
    }
  }
  if (checked.triangle_count == 0)
    return absl::InvalidArgumentError(fmt::format("{}: it has no faces", path));
  if (checked.triangle_count > kMaxTriangles) {
    return absl::ResourceExhaustedError(fmt::format("{}: {} triangles, the limit is {}", path,
                                                    checked.triangle_count, kMaxTriangles));
  }
  return checked;
}

absl::StatusOr<std::vector<std::string>> CheckMtl(std::string_view text, const std::string& path) {
  static constexpr std::array<std::string_view, 5> kColors = {"Ka", "Kd", "Ks", "Ke", "Tf"};
  static constexpr std::array<std::string_view, 5> kNumbers = {"Ns", "Ni", "d", "Tr", "illum"};
  const auto has = [](const auto& words, std::string_view word) {
    return std::find(words.begin(), words.end(), word) != words.end();
  };
  std::vector<std::string> names;
  Statements statements(text);
  while (const auto statement = statements.Next()) {
    std::string_view rest = *statement;
    const std::string_view keyword = TakeWord(rest);
    std::string error;
    if (keyword == "newmtl") {
      names.emplace_back(Trim(rest));
    } else if (has(kColors, keyword) || has(kNumbers, keyword)) {
      const int count = has(kColors, keyword) ? 3 : 1;
      error = CheckNumbers(rest, count, count, 0, kMaxFloat);
      if (!error.empty()) error = fmt::format("{}: {}", keyword, error);
    }
    if (!error.empty()) return ErrorAt(path, statements.line(), error);
  }
  return names;
}

}  // namespace treelight::client
