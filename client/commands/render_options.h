#ifndef TREELIGHT_CLIENT_COMMANDS_RENDER_OPTIONS_H_
#define TREELIGHT_CLIENT_COMMANDS_RENDER_OPTIONS_H_

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "CLI/CLI.hpp"
#include "client/commands/scene_option.h"
#include "client/render/path_tracer.h"
#include "client/render/photon_renderer.h"

namespace treelight::client {

/// Maps outlive a renderer that was killed by no more than this.
inline constexpr std::chrono::hours kTimeToLive{24};

/// Samples per pixel of a reference where nothing is said.
inline constexpr std::uint32_t kReferenceSamples = 256;

/// Passes of a progressive render where nothing is said of its end.
inline constexpr std::uint64_t kProgressivePasses = 64;

/// Error that `--photons auto` ends at where nothing is said: about what a picture of the default
/// numbers has (docs/rendering.md).
inline constexpr double kAutoTargetError = 0.05;

/// The largest radius of an estimate from each map, scene units; nothing where there is no map.
struct GatherRadii {
  std::optional<float> indirect{}, caustic{};
};

/// What the command line of `render` says.
struct RenderChoice {
  SceneChoice scene;
  std::uint64_t photon_count = 1'000'000, caustic_photon_count = 200'000, seed = 1;
  bool auto_photons = false;  ///< progressive, in passes that a pilot plans
  bool gives_k = false;       ///< --k was given: the plan keeps it
  std::optional<std::uint32_t> samples_per_pixel;
  PhotonRenderOptions render;    ///< samples, seed, radii and callbacks are set by others
  GatherRadii radii;             ///< nothing: they follow the photons (RadiusOfNearest)
  float max_relative_error = 0;  ///< Approximation, of gathers from either map
  std::string map_name;          ///< empty: the scene's name
  bool keep_maps = false;

  bool reference = false;         ///< path-trace instead
  bool allow_incomplete = false;  ///< even where MissingFromReference says something
  double target_noise = 0;        ///< PathTraceOptions

  bool progressive = false;  ///< in passes; the fields below are of it alone
  std::optional<std::uint64_t> passes;
  double target_error = 0;  ///< ProgressiveOptions; 0: none
  std::optional<double> time_limit_s;
  std::string error_curve_folder;  ///< empty: no curve

  std::vector<std::string> output_paths;  ///< not empty once the command line is checked
  std::optional<float> exposure;          ///< stops; nothing: the scene's
  bool layers = false;                    ///< albedo and normals into EXR files
  std::string preview_path;               ///< empty: no preview
  double preview_interval_s = 2;
  std::string compare_path;  ///< empty: no comparison

  /// kProgressivePasses where nothing else ends a progressive render.
  std::uint64_t max_passes() const;
  /// For RenderPhotonMaps, with the radii that were given or chosen.
  PhotonRenderOptions photon_options(const GatherRadii& chosen) const;
  PathTraceOptions reference_options() const;  ///< for PathTrace
};

/// Adds the options of `render` to `command`. They are parsed to `choice`, which must outlive the
/// parsing.
void AddRenderOptions(CLI::App& command, RenderChoice& choice);

/// Completes what was parsed, and throws CLI::ValidationError where options do not go together.
void CheckRenderOptions(RenderChoice& choice);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_RENDER_OPTIONS_H_
