#ifndef TREELIGHT_CLIENT_RENDER_PROGRESSIVE_RENDERER_H_
#define TREELIGHT_CLIENT_RENDER_PROGRESSIVE_RENDERER_H_

#include <chrono>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "client/photon_map_client.h"
#include "client/render/gather_radius.h"
#include "client/render/pass_maps.h"
#include "client/render/pass_statistics.h"
#include "client/render/photon_renderer.h"
#include "client/trace/intersector.h"

namespace treelight::client {

/// The fewest neighbours of a first pass, where k > 0: of fewer less than eight passes can be
/// probed for blur.
inline constexpr std::uint32_t kMinProgressiveNeighbors = 24;

/// Passes before a target error is believed to be reached, where nothing is known beforehand.
inline constexpr std::uint64_t kMinPassesOfTarget = 8;

/// Passes that tell as much of the blur as what is known of it beforehand.
inline constexpr double kPassesOfKnownBias = 2;

/// What one pass cost, and what is known after it.
struct PassReport {
  std::uint64_t passes = 0;               ///< done so far, this one included
  double seconds = 0;                     ///< since the begin of the run
  std::uint64_t photons = 0;              ///< of all passes so far, both sets
  EstimateOptions indirect{}, caustic{};  ///< of this pass; radius 0: there is no such map
  std::optional<ErrorEstimate> error{};   ///< of the mean of the passes; after the second pass
};

/// What RenderProgressively renders, and when it ends.
struct ProgressiveOptions {
  /// Of a pass: its samples per pixel, k and kernels of the first pass. Seeds, radii, previews and
  /// callbacks are set by the renderer.
  PhotonRenderOptions pass{.camera = {.samples_per_pixel = 1}};
  FirstRadius indirect{.k = 100, .quantile = kIndirectRadiusQuantile};
  FirstRadius caustic{.k = 60, .quantile = kCausticRadiusQuantile};
  std::uint64_t indirect_photons = 1'000'000, caustic_photons = 200'000;  ///< of each pass
  std::uint64_t seed = 1;                                                 ///< of all random numbers
  const PhotonEmitters* emitters = nullptr;  ///< as PhotonTraceOptions; of all passes
  /// The maps are NAME.indirect and NAME.caustic, a version for each pass; another run's must not
  /// be called so.
  std::string map_name = "progressive";
  std::chrono::milliseconds time_to_live = std::chrono::hours(1);  ///< longer than a pass takes

  /// Of the first radius, where something is known of it beforehand, since few passes tell little:
  /// counts as much in the estimate as kPassesOfKnownBias passes. It goes with the squared radius.
  /// 0: nothing is known.
  double known_squared_bias = 0;
  std::uint64_t constant_passes = 1;  ///< > 0, with the radius of the first; later it shrinks
  /// Of the estimate of passes of the first radius: where it is more, they are too blurred.
  double max_squared_bias = std::numeric_limits<double>::infinity();

  std::uint64_t max_passes = std::numeric_limits<std::uint64_t>::max();  ///< > 0
  double target_error = 0;  ///< ErrorEstimate::relative_rms(); 0: none
  std::uint64_t min_passes_of_target = kMinPassesOfTarget;  ///< > 1, before it is believed
  double time_limit_s = std::numeric_limits<double>::infinity();
  CancelCheck interrupted{};  ///< true: end, with the passes that are done; any thread

  PreviewOptions preview{};  ///< the mean of the passes; before, what there is of the first
  /// Called after each pass, on the calling thread; an error ends the run.
  std::function<absl::Status(const PassReport&, const PassStatistics&)> pass_done{};
};

/// Why a run ended.
enum class ProgressiveEnd { kPasses, kTargetError, kTimeLimit, kTooBlurred, kInterrupted };

/// The mean of the passes, and what they cost.
struct ProgressiveResult {
  Image image;
  PassReport last;
  ProgressiveEnd end = ProgressiveEnd::kPasses;
  double photons_s = 0;   ///< photons were traced, sent and built from, beside the pictures
  double pictures_s = 0;  ///< pictures were gathered
  double waited_s = 0;    ///< a picture waited for its maps
  absl::Status deleted;   ///< the first error of deleting maps; they expire
};

/// Stochastic progressive photon mapping (Hachisuka and Jensen 2009): every pass traces photons,
/// builds maps of them on the server, and gathers at the hits of fresh camera rays; the picture is
/// the mean of the passes. The radius shrinks from pass to pass without regard to what was found
/// (Knaus and Zwicker 2011; ShrinkingRadius), so that passes are independent pictures: any number
/// of photons is used in bounded memory, nothing is kept for a hit, a server sees but maps and
/// gathers, and the spread of the passes tells their noise.
///
/// While a pass is gathered the photons of the next are traced, sent and built from. At most two
/// passes have maps on the server; each is deleted after its pass.
///
/// A run ends at max_passes, when the estimate is within target_error, when the next pass would end
/// after time_limit_s, when the first radius blurs more than it may, or when it is interrupted; the
/// pass that is under way then is dropped, unless the time is up in the first. The same picture for
/// any number of threads, where passes alone end it.
///
/// Blocks. INVALID_ARGUMENT: an option out of range. CANCELLED: interrupted before the first pass
/// was done. Else the errors of TracePhotons, PhotonMapClient and pass_done; after one the preview
/// has the passes that were done.
absl::StatusOr<ProgressiveResult> RenderProgressively(const Intersector& intersector,
                                                      PhotonMapClient& client,
                                                      const ProgressiveOptions& options);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PROGRESSIVE_RENDERER_H_
