#ifndef TREELIGHT_TESTS_CHANGE_JSON_H_
#define TREELIGHT_TESTS_CHANGE_JSON_H_

#include <random>
#include <vector>

#include "nlohmann/json.hpp"

namespace treelight::testing {

/// Puts a value of any kind in the place of one that is drawn at random, or takes it out.
inline void ChangeJson(nlohmann::json& json, std::mt19937& random) {
  using Json = nlohmann::json;
  static const std::vector<Json> kValues = {
      -1,   0,    1,  2,    65536, 4294967295u, 1e300,         -5.5,           "x",
      "",   true, {}, 5126, 5123,  "SCALAR",    Json::array(), Json::object(), Json::array({1, 2}),
      "2.0"};
  std::vector<std::pair<Json*, Json::iterator>> places;  // container and member
  std::vector<Json*> open = {&json};
  while (!open.empty()) {
    Json* const container = open.back();
    open.pop_back();
    if (!container->is_structured()) continue;
    for (auto member = container->begin(); member != container->end(); ++member) {
      places.emplace_back(container, member);
      open.push_back(&*member);
    }
  }
  if (places.empty()) return;
  auto& [container, member] = places[random() % places.size()];
  if (random() % 5 == 0) {
    container->erase(member);
  } else {
    *member = kValues[random() % kValues.size()];
  }
}

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_CHANGE_JSON_H_
