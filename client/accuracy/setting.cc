#include "client/accuracy/setting.h"

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
    case Knob::kRadius:
      return "radius";
    case Knob::kWeightTolerance:
      return "weight_tolerance";
    case Knob::kMerged:
      return "merged_photons";
    case Knob::kError:
      return "max_relative_error";
    case Knob::kThinned:
      return "thinned_photons";
    case Knob::kMergedWithin:
      return "merged_within";
    case Knob::kThinnedWithin:
      return "thinned_within";
    case Knob::kErrorWithin:
      return "error_within";
    case Knob::kQuantized:
      return "quantized";
    case Knob::kHalves:
      return "halves";
    case Knob::kCompact:
      return "quantized_halves";
  }
  return "unknown";
}

bool IsWithinRadius(Knob knob) {
  return knob == Knob::kRadius || knob == Knob::kWeightTolerance || knob == Knob::kMergedWithin ||
         knob == Knob::kThinnedWithin || knob == Knob::kErrorWithin;
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
    case Knob::kThinned:
    case Knob::kThinnedWithin:
      approximation.thinned_photons = static_cast<std::uint32_t>(setting.value);
      break;
    case Knob::kNone:
    case Knob::kRadius:
    case Knob::kQuantized:
    case Knob::kHalves:
    case Knob::kCompact:
      break;
  }
  if (IsWithinRadius(setting.knob)) options.k = 0;
  return options;
}

WireOptions WireOf(const Setting& setting) {
  const bool both = setting.knob == Knob::kCompact;
  return {.quantize_queries = both || setting.knob == Knob::kQuantized,
          .answer_floats = both || setting.knob == Knob::kHalves ? v1::FLOAT_FORMAT_HALF
                                                                 : v1::FLOAT_FORMAT_FLOAT32};
}

std::vector<Setting> SettingGrid(const std::vector<std::uint32_t>& ks,
                                 const std::vector<double>& errors) {
  std::vector<Setting> grid;
  for (const std::uint32_t k : ks) {
    const auto add = [&](Knob knob, std::initializer_list<double> values) {
      for (const double value : values) grid.push_back({knob, value, k});
    };
    for (const Knob wire : {Knob::kNone, Knob::kQuantized, Knob::kHalves, Knob::kCompact}) {
      add(wire, {0});
    }
    add(Knob::kEpsilon, {0.1, 0.3, 1, 3});
    // By the blocks of 32 photons that k fill.
    const double blocks = std::ceil(k / 32.0);
    add(Knob::kMaxLeaves, {blocks + 1, 2 * blocks + 1, 4 * blocks + 1, 8 * blocks + 1});
    add(Knob::kMerged, {2, 4, 8, 16, 32});
    add(Knob::kThinned, {2, 4, 8, 16, 32});
    for (const double error : errors) add(Knob::kError, {error});
    add(Knob::kRadius, {0});
    add(Knob::kWeightTolerance, {0.001, 0.02, 0.1});
    add(Knob::kMergedWithin, {2, 4, 8, 16, 32});
    add(Knob::kThinnedWithin, {2, 4, 8, 16, 32});
    for (const double error : errors) add(Knob::kErrorWithin, {error});
  }
  return grid;
}

}  // namespace treelight::client
