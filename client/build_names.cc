#include "client/build_names.h"

#include <algorithm>
#include <array>
#include <utility>

namespace treelight::client {
namespace {

constexpr std::array<std::pair<std::string_view, v1::BuilderKind>, 7> kBuilders = {
    {{"lbvh", v1::BUILDER_KIND_LBVH},
     {"treelet", v1::BUILDER_KIND_TREELET},
     {"hybrid", v1::BUILDER_KIND_HYBRID},
     {"trbvh", v1::BUILDER_KIND_TRBVH},
     {"atrbvh", v1::BUILDER_KIND_ATRBVH},
     {"balanced", v1::BUILDER_KIND_BALANCED},
     {"karras", v1::BUILDER_KIND_KARRAS}}};

constexpr std::array<std::pair<std::string_view, v1::Heuristic>, 3> kHeuristics = {
    {{"sah", v1::HEURISTIC_SAH}, {"isa", v1::HEURISTIC_ISA}, {"vvh", v1::HEURISTIC_VVH}}};

}  // namespace

std::vector<std::string> HeuristicNames() {
  std::vector<std::string> names;
  for (const auto& [name, heuristic] : kHeuristics) names.emplace_back(name);
  return names;
}

std::vector<std::string> BuilderNames() {
  std::vector<std::string> names;
  for (const auto& [name, builder] : kBuilders) names.emplace_back(name);
  for (const std::string& name : HeuristicNames()) names.push_back(name);
  return names;
}

bool SetBuilder(std::string_view name, v1::BuildOptions& options) {
  const auto found = std::find_if(kBuilders.begin(), kBuilders.end(),
                                  [name](const auto& entry) { return entry.first == name; });
  if (found != kBuilders.end()) {
    options.set_builder(found->second);
    return true;
  }
  const v1::Heuristic heuristic = HeuristicNamed(name);
  if (heuristic == v1::HEURISTIC_UNSPECIFIED) return false;
  options.set_builder(v1::BUILDER_KIND_SWEEP);
  options.set_heuristic(heuristic);
  return true;
}

v1::Heuristic HeuristicNamed(std::string_view name) {
  const auto found = std::find_if(kHeuristics.begin(), kHeuristics.end(),
                                  [name](const auto& entry) { return entry.first == name; });
  return found == kHeuristics.end() ? v1::HEURISTIC_UNSPECIFIED : found->second;
}

std::string NameOf(v1::Heuristic heuristic) {
  const auto found = std::find_if(kHeuristics.begin(), kHeuristics.end(),
                                  [&](const auto& entry) { return entry.second == heuristic; });
  return found == kHeuristics.end() ? std::string() : std::string(found->first);
}

}  // namespace treelight::client
