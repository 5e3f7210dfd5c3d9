#include "client/scenes/material_json.h"

#include <charconv>
#include <string>
#include <vector>

#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {
namespace {

/// A number, three numbers separated by commas, or else a word.
nlohmann::json ParseValue(std::string_view text) {
  std::vector<double> numbers;
  for (std::string_view rest = text;;) {
    const std::size_t comma = std::min(rest.find(','), rest.size());
    double number = 0;
    const auto [stop, error] = std::from_chars(rest.data(), rest.data() + comma, number);
    if (error != std::errc() || stop != rest.data() + comma) return std::string(text);
    numbers.push_back(number);
    if (comma == rest.size()) break;
    rest.remove_prefix(comma + 1);
  }
  if (numbers.size() == 1) return numbers[0];
  return numbers;
}

}  // namespace

void ReadMaterial(JsonObject& json, Material& material) {
  const auto number = [&json](const char* key, NumberRange range, float otherwise) {
    return static_cast<float>(json.Number(key, range, otherwise));
  };
  material.surface = static_cast<Surface>(
      json.Choice("surface", {"diffuse", "glossy", "mirror", "dielectric", "pane"},
                  static_cast<int>(material.surface)));
  material.reflectance = json.Color("reflectance", kShare, material.reflectance);
  material.specular = json.Color("specular", kShare, material.specular);
  material.exponent = number("exponent", {0, 1e6}, material.exponent);
  material.ior = number("ior", {0.01, 100}, material.ior);
  material.transmittance = json.Color("transmittance", kShare, material.transmittance);
  material.emission = json.Color("emission", kNotNegative, material.emission);
  json.RefuseOtherKeys();
  const float sum = MaxChannel(material.reflectance + material.specular);
  if (material.surface == Surface::kGlossy && sum > 1 + 1e-6f) {
    json.Fail("", fmt::format("reflectance and specular together are {:g}, more than 1: it would "
                              "give light",
                              sum));
  }
}

absl::Status OverrideMaterial(std::string_view assignment, Scene& scene) {
  // A name may have colons, a value has none.
  const std::size_t equals = assignment.find_last_of('=');
  const std::size_t colon = assignment.substr(0, equals).find_last_of(':');
  if (equals == assignment.npos || colon == assignment.npos || colon == 0) {
    return absl::InvalidArgumentError(fmt::format(
        "--material: '{}' is not of the form NAME:KEY=VALUE", assignment.substr(0, 80)));
  }
  const std::string name(assignment.substr(0, colon));
  const std::string key(assignment.substr(colon + 1, equals - colon - 1));
  const nlohmann::json fields = {{key, ParseValue(assignment.substr(equals + 1))}};
  absl::Status status;
  std::vector<std::string_view> names;
  bool found = false;
  for (Material& material : scene.materials) {
    names.push_back(material.name);
    if (material.name != name) continue;
    JsonObject json(fields, "--material", name, status);
    ReadMaterial(json, material);
    found = true;
  }
  if (!found) {
    return absl::NotFoundError(fmt::format("--material: there is no material \"{}\"; there are: {}",
                                           name, fmt::join(names, ", ")));
  }
  return status;
}

}  // namespace treelight::client
