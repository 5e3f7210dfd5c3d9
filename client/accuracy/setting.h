#ifndef TREELIGHT_CLIENT_ACCURACY_SETTING_H_
#define TREELIGHT_CLIENT_ACCURACY_SETTING_H_

#include <cstdint>
#include <string_view>
#include <vector>

#include "client/photon_map_client.h"
#include "core/gatherer.h"

namespace treelight::client {

/// What is given up.
enum class Knob {
  kNone,             ///< exact, of the k nearest
  kEpsilon,          ///< Approximation::epsilon
  kMaxLeaves,        ///< Approximation::max_leaves
  kRadius,           ///< exact, of all within the radius of k photons
  kWeightTolerance,  ///< Approximation::weight_tolerance, of the same
  kMerged,           ///< Approximation::merged_photons, of the k nearest
  kError,            ///< Approximation::max_relative_error, of the same
  kThinned,          ///< Approximation::thinned_photons, of the k nearest
  kMergedWithin,     ///< merged_photons, of all within the radius
  kThinnedWithin,    ///< thinned_photons, of the same
  kErrorWithin,      ///< max_relative_error, of the same
  kQuantized,        ///< WireOptions::quantize_queries, else exact
  kHalves,           ///< WireOptions::answer_floats, else exact
  kCompact,          ///< both
};

/// "exact", "epsilon", "max_leaves", "radius", "weight_tolerance", "merged_photons",
/// "max_relative_error", "thinned_photons", "merged_within", "thinned_within", "error_within",
/// "quantized", "halves", "quantized_halves".
std::string_view KnobName(Knob knob);

/// Whether it asks for all photons within a radius, not for the k nearest.
bool IsWithinRadius(Knob knob);

/// Whether it asks for an error and leaves the rest to the server.
bool AsksForError(Knob knob);

/// One place of the grid.
struct Setting {
  Knob knob = Knob::kNone;
  double value = 0;     ///< of the knob
  std::uint32_t k = 0;  ///< neighbours; of a gather within a radius, those that it holds by median
};

/// What is asked of the server for it; a radius is left to the caller.
GatherOptions OptionsOf(const Setting& setting);

/// How it travels.
WireOptions WireOf(const Setting& setting);

/// The grid: for each k the exact gathers and a row of values for each knob.
/// @param errors  of the settings that ask for one
std::vector<Setting> SettingGrid(const std::vector<std::uint32_t>& ks,
                                 const std::vector<double>& errors);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_ACCURACY_SETTING_H_
