#include "client/scenes/json_object.h"

#include <cmath>
#include <utility>

#include "client/scenes/vector.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {
namespace {

using nlohmann::json;

/// `value` as it may stand in a message.
std::string Show(const json& value) {
  std::string text = value.dump(-1, ' ', true, json::error_handler_t::replace);
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

/// What is wrong with a number; empty: nothing.
std::string CheckNumber(const json& value, NumberRange range) {
  if (!value.is_number()) return fmt::format("a number, not {}", Show(value));
  const auto number = value.get<double>();
  if (number >= range.min && number <= range.max) return {};
  return fmt::format("{} is not within [{:g}, {:g}]", Show(value), range.min, range.max);
}

}  // namespace

JsonObject::JsonObject(const json& value, std::string file, std::string place, absl::Status& status)
    : json_(&value), file_(std::move(file)), place_(std::move(place)), status_(&status) {
  static const json kEmpty = json::object();
  if (value.is_object()) return;
  Fail("", fmt::format("an object, not {}", Show(value)));
  json_ = &kEmpty;
}

bool JsonObject::Has(std::string_view key) const { return json_->contains(key); }

std::string JsonObject::PlaceOf(std::string_view key) const {
  return place_.empty() || key.empty() ? place_ + std::string(key)
                                       : fmt::format("{}.{}", place_, key);
}

void JsonObject::Fail(std::string_view key, std::string_view error) {
  if (!status_->ok()) return;
  const std::string place = PlaceOf(key);
  *status_ =
      absl::InvalidArgumentError(place.empty() ? fmt::format("{}: {}", file_, error)
                                               : fmt::format("{}: {}: {}", file_, place, error));
}

const json* JsonObject::Find(const char* key, bool required) {
  asked_.insert(key);
  const auto found = json_->find(key);
  if (found != json_->end()) return &*found;
  if (required) Fail("", fmt::format("\"{}\" is missing", key));
  return nullptr;
}

double JsonObject::Number(const char* key, NumberRange range, std::optional<double> otherwise) {
  const json* const value = Find(key, !otherwise);
  if (value == nullptr) return otherwise.value_or(0);
  const auto error = CheckNumber(*value, range);
  if (error.empty()) return value->get<double>();
  Fail(key, error);
  return otherwise.value_or(0);
}

std::string JsonObject::Text(const char* key, const std::optional<std::string>& otherwise) {
  const json* const value = Find(key, !otherwise);
  if (value == nullptr) return otherwise.value_or("");
  if (value->is_string()) return value->get<std::string>();
  Fail(key, fmt::format("a string, not {}", Show(*value)));
  return otherwise.value_or("");
}

int JsonObject::Choice(const char* key, const std::vector<std::string_view>& names,
                       std::optional<int> otherwise) {
  const json* const value = Find(key, !otherwise);
  if (value == nullptr) return otherwise.value_or(0);
  for (std::size_t i = 0; value->is_string() && i < names.size(); ++i) {
    if (value->get_ref<const std::string&>() == names[i]) return static_cast<int>(i);
  }
  Fail(key, fmt::format("one of {}, not {}", fmt::join(names, ", "), Show(*value)));
  return otherwise.value_or(0);
}

std::vector<double> JsonObject::Numbers(const char* key, std::size_t count, NumberRange range) {
  std::vector<double> numbers(count);
  const json* const value = Find(key, true);
  if (value == nullptr) return numbers;
  if (!value->is_array()) {
    Fail(key, fmt::format("{} numbers, not {}", count, Show(*value)));
  } else if (value->size() != count) {
    Fail(key, fmt::format("{} numbers, not {}", count, value->size()));
  } else {
    for (std::size_t i = 0; i < count; ++i) {
      const auto error = CheckNumber((*value)[i], range);
      if (error.empty()) {
        numbers[i] = (*value)[i].get<double>();
      } else {
        Fail(fmt::format("{}[{}]", key, i), error);
      }
    }
  }
  return numbers;
}

Vec3 JsonObject::Vector(const char* key, std::optional<Vec3> otherwise) {
  asked_.insert(key);
  if (otherwise && !Has(key)) return *otherwise;
  const std::vector<double> v = Numbers(key, 3, kAnyNumber);
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

Vec3 JsonObject::Direction(const char* key, std::optional<Vec3> otherwise) {
  const Vec3 v = Vector(key, otherwise);
  const float length = Length(v);
  if (std::isfinite(length) && length > 0) return Normalize(v);
  if (Has(key)) Fail(key, "it has no direction");
  return {0, 1, 0};
}

Rgb JsonObject::Color(const char* key, NumberRange range, std::optional<Rgb> otherwise) {
  asked_.insert(key);
  if (otherwise && !Has(key)) return *otherwise;
  if (Has(key) && (*json_)[key].is_number()) {
    const auto grey = static_cast<float>(Number(key, range));
    return {grey, grey, grey};
  }
  const std::vector<double> c = Numbers(key, 3, range);
  return {static_cast<float>(c[0]), static_cast<float>(c[1]), static_cast<float>(c[2])};
}

std::vector<std::string> JsonObject::Texts(const char* key) {
  std::vector<std::string> texts;
  const json* const value = Find(key, false);
  if (value == nullptr) return texts;
  if (!value->is_array()) Fail(key, fmt::format("an array of strings, not {}", Show(*value)));
  for (std::size_t i = 0; value->is_array() && i < value->size(); ++i) {
    if ((*value)[i].is_string()) {
      texts.push_back((*value)[i].get<std::string>());
    } else {
      Fail(fmt::format("{}[{}]", key, i), fmt::format("a string, not {}", Show((*value)[i])));
    }
  }
  return texts;
}

std::vector<JsonObject> JsonObject::Objects(const char* key) {
  std::vector<JsonObject> objects;
  const json* const value = Find(key, false);
  if (value == nullptr) return objects;
  if (!value->is_array()) Fail(key, fmt::format("an array of objects, not {}", Show(*value)));
  for (std::size_t i = 0; value->is_array() && i < value->size(); ++i)
    objects.emplace_back((*value)[i], file_, PlaceOf(fmt::format("{}[{}]", key, i)), *status_);
  return objects;
}

std::vector<std::pair<std::string, JsonObject>> JsonObject::Members(const char* key) {
  std::vector<std::pair<std::string, JsonObject>> members;
  const json* const value = Find(key, false);
  if (value == nullptr) return members;
  if (!value->is_object()) Fail(key, fmt::format("an object, not {}", Show(*value)));
  for (const auto& [name, member] : value->items()) {
    if (!value->is_object()) break;
    members.emplace_back(
        name, JsonObject(member, file_, PlaceOf(fmt::format("{}.{}", key, name)), *status_));
  }
  return members;
}

void JsonObject::RefuseOtherKeys() {
  for (const auto& [key, value] : json_->items()) {
    if (!asked_.contains(key)) {
      Fail("", fmt::format("unknown key {}; known: {}", Show(key), fmt::join(asked_, ", ")));
    }
  }
}

}  // namespace treelight::client
