#ifndef TREELIGHT_CLIENT_SCENES_JSON_OBJECT_H_
#define TREELIGHT_CLIENT_SCENES_JSON_OBJECT_H_

#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "client/scenes/color.h"
#include "core/model/box.h"
#include "nlohmann/json.hpp"

namespace treelight::client {

/// What a number may be.
struct NumberRange {
  double min = -1e18, max = 1e18;
};
inline constexpr NumberRange kAnyNumber{};
inline constexpr NumberRange kNotNegative{0, 1e18};
inline constexpr NumberRange kPositive{1e-18, 1e18};
inline constexpr NumberRange kShare{0, 1};

/// An object of a JSON file and where it stands, for messages. The first error is kept in the
/// status that all objects of the file share, "FILE: lights[1].intensity: 3 numbers, not 2"; what
/// is read with or after an error is the default. The JSON and the status must outlive it.
class JsonObject {
 public:
  /// `place` is the path in the file, empty for its root.
  JsonObject(const nlohmann::json& json, std::string file, std::string place, absl::Status& status);

  const std::string& place() const { return place_; }
  bool Has(std::string_view key) const;

  // The values of keys. Without `otherwise` the key must be there.
  double Number(const char* key, NumberRange range, std::optional<double> otherwise = {});
  std::string Text(const char* key, const std::optional<std::string>& otherwise = {});
  /// One of `names`, as its index.
  int Choice(const char* key, const std::vector<std::string_view>& names,
             std::optional<int> otherwise = {});
  std::vector<double> Numbers(const char* key, std::size_t count, NumberRange range);
  Vec3 Vector(const char* key, std::optional<Vec3> otherwise = {});
  /// A vector that is not 0, scaled to length 1.
  Vec3 Direction(const char* key, std::optional<Vec3> otherwise = {});
  /// [red, green, blue], or one number for all three.
  Rgb Color(const char* key, NumberRange range, std::optional<Rgb> otherwise = {});
  std::vector<std::string> Texts(const char* key);   ///< an array of strings; empty if not there
  std::vector<JsonObject> Objects(const char* key);  ///< an array of objects; empty if not there
  std::vector<std::pair<std::string, JsonObject>> Members(
      const char* key);  ///< of an object of objects

  /// An error unless every key was asked for: call it after reading the rest.
  void RefuseOtherKeys();

  /// Keeps `error` about `key`, or about the object where that is empty.
  void Fail(std::string_view key, std::string_view error);

 private:
  // The value; null, and an error where it is `required`, if it is not there.
  const nlohmann::json* Find(const char* key, bool required);
  std::string PlaceOf(std::string_view key) const;

  const nlohmann::json* json_;
  std::string file_, place_;
  absl::Status* status_;
  std::set<std::string, std::less<>> asked_;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_JSON_OBJECT_H_
