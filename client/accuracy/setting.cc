#include "client/accuracy/setting.h"

#include <algorithm>
#include <cmath>

namespace treelight::client {

std::string_view KnobName(Knob knob) {
  switch (knob) {
    case Knob::kNone:
      return "exact";
    case Knob::kEpsilon:
      return "epsilon";
    case Knob::kMaxLeaves:
      return "max_leaves";
    case Knob::kFraction:
      return "fraction";
    case Knob::kRadius:
      return "radius";
    case Knob::kWeightTolerance:
      return "weight_tolerance";
    case Knob::kMerged:
      return "merged_photons";
    case Knob::kError:
      return "max_relative_error";
    case Knob::kMergedWithin:
      return "merged_within";
    case Knob::kErrorWithin:
      return "error_within";
  }
  return "unknown";
}

bool IsWithinRadius(Knob knob) {
  return knob == Knob::kRadius || knob == Knob::kWeightTolerance || knob == Knob::kMergedWithin ||
         knob == Knob::kErrorWithin;
}

bool AsksForError(Knob knob) { return knob == Knob::kError || knob == Knob::kErrorWithin; }

GatherOptions OptionsOf(const Setting& setting) {
  GatherOptions options{.k = setting.k, .outputs = kOutputDensity};
  Approximation& approximation = options.approximation;
  switch (setting.knob) {
    case Knob::kEpsilon:
      approximation.epsilon = static_cast<float>(setting.value);
      break;
    case Knob::kMaxLeaves:
      approximation.max_leaves = static_cast<std::uint32_t>(setting.value);
      break;
    case Knob::kFraction:
      options.k = std::max(1u, static_cast<std::uint32_t>(std::lround(setting.value * setting.k)));
      break;
    case Knob::kWeightTolerance:
      approximation.weight_tolerance = static_cast<float>(setting.value);
      break;
    case Knob::kMerged:
    case Knob::kMergedWithin:
      approximation.merged_photons = static_cast<std::uint32_t>(setting.value);
      break;
    case Knob::kError:
    case Knob::kErrorWithin:
      approximation.max_relative_error = static_cast<float>(setting.value);
      break;
    case Knob::kNone:
    case Knob::kRadius:
      break;
  }
  if (IsWithinRadius(setting.knob)) options.k = 0;
  return options;
}

std::vector<Setting> SettingGrid(const std::vector<std::uint32_t>& ks,
                                 const std::vector<double>& errors) {
  std::vector<Setting> grid;
  for (const std::uint32_t k : ks) {
    const auto add = [&](Knob knob, std::initializer_list<double> values) {
      for (const double value : values) grid.push_back({knob, value, k});
    };
    add(Knob::kNone, {0});
    add(Knob::kEpsilon, {0.1, 0.3, 1, 3});
    // By the blocks of 32 photons that k fill.
    const double blocks = std::ceil(k / 32.0);
    add(Knob::kMaxLeaves, {blocks + 1, 2 * blocks + 1, 4 * blocks + 1, 8 * blocks + 1});
    add(Knob::kFraction, {0.5, 0.25, 0.1});
    add(Knob::kMerged, {2, 4, 8, 16, 32});
    for (const double error : errors) add(Knob::kError, {error});
    add(Knob::kRadius, {0});
    add(Knob::kWeightTolerance, {0.001, 0.02, 0.1});
    add(Knob::kMergedWithin, {2, 4, 8, 16, 32});
    for (const double error : errors) add(Knob::kErrorWithin, {error});
  }
  return grid;
}

}  // namespace treelight::client
