#include "client/render/progressive_renderer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>
#include <utility>

#include "client/render/shrinking_radius.h"
#include "client/render/stopwatch.h"
#include "client/trace/random.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

/// The fewest neighbours of an estimate that is probed: a quarter of them still tells something.
constexpr std::uint32_t kMinProbedNeighbors = 12;

absl::Status CheckFirst(std::string_view name, std::uint32_t k, const FirstRadius& first) {
  if (k > 0 && k < kMinProgressiveNeighbors) {
    return absl::InvalidArgumentError(
        fmt::format("{}: k {} is under {}: it shrinks from pass to pass; 0 takes all within the "
                    "radius",
                    name, k, kMinProgressiveNeighbors));
  }
  if (!first.given && first.k == 0)
    return absl::InvalidArgumentError(fmt::format("{}: neither a radius nor a k for it", name));
  return absl::OkStatus();
}

absl::Status CheckOptions(const ProgressiveOptions& options) {
  if (options.max_passes == 0) return absl::InvalidArgumentError("max_passes is 0");
  if (options.constant_passes == 0) return absl::InvalidArgumentError("constant_passes is 0");
  if (options.min_passes_of_target < 2) {
    return absl::InvalidArgumentError(
        fmt::format("min_passes_of_target is {}", options.min_passes_of_target));
  }
  if (!(options.known_squared_bias >= 0)) {
    return absl::InvalidArgumentError(
        fmt::format("known_squared_bias is {}", options.known_squared_bias));
  }
  if (!(options.max_squared_bias >= 0)) {
    return absl::InvalidArgumentError(
        fmt::format("max_squared_bias is {}", options.max_squared_bias));
  }
  if (!(options.target_error >= 0)) {
    return absl::InvalidArgumentError(fmt::format("target_error is {}", options.target_error));
  }
  if (!(options.time_limit_s >= 0)) {
    return absl::InvalidArgumentError(fmt::format("time_limit_s is {}", options.time_limit_s));
  }
  if (auto status = CheckFirst("indirect", options.pass.indirect.k, options.indirect); !status.ok())
    return status;
  return CheckFirst("caustic", options.pass.caustic.k, options.caustic);
}

/// One run: makes the maps of passes beside their pictures, and deletes them.
class Run {
 public:
  Run(const Intersector& intersector, PhotonMapClient& client, const ProgressiveOptions& options)
      : intersector_(intersector),
        client_(client),
        options_(options),
        emitters_(options.emitters == nullptr ? std::optional<PhotonEmitters>(intersector.scene())
                                              : std::nullopt),
        radius_(options.constant_passes),
        statistics_(options.pass.width, options.pass.height),
        preview_(options.preview) {}

  ~Run() { StopMaking(); }

  absl::StatusOr<ProgressiveResult> Render() {
    next_ = Make(0);
    for (std::uint64_t pass = 0;; ++pass) {
      if (const auto end = EndBefore(pass)) return Finish(*end);
      const Stopwatch waiting;
      const auto maps = next_.get();
      result_.waited_s += waiting.Seconds();
      if (!maps.ok()) return EndBy(maps.status());
      // A pass may store no photon of a set that others have.
      if (maps->indirect_radius) indirect_radius_ = maps->indirect_radius;
      if (maps->caustic_radius) caustic_radius_ = maps->caustic_radius;
      if (pass + 1 < options_.max_passes) next_ = Make(pass + 1);

      const auto status = RenderPass(pass, *maps);
      Delete(maps->maps);
      if (!status.ok()) return EndBy(status);
      radius_.Advance();
    }
  }

 private:
  bool Interrupted() const { return options_.interrupted && options_.interrupted(); }

  /// A first pass is rendered however long it takes.
  bool TimeIsUp(std::uint64_t pass) const {
    return pass > 0 && begin_.Seconds() > options_.time_limit_s;
  }

  /// Why pass `pass` is not begun; nothing: it is.
  std::optional<ProgressiveEnd> EndBefore(std::uint64_t pass) const {
    if (Interrupted()) return ProgressiveEnd::kInterrupted;
    const PassReport& last = result_.last;
    if (pass >= options_.min_passes_of_target &&
        last.error->relative_rms() <= options_.target_error)
      return ProgressiveEnd::kTargetError;
    if (pass == options_.max_passes) return ProgressiveEnd::kPasses;
    if (pass >= options_.min_passes_of_target && pass <= options_.constant_passes &&
        last.error->squared_bias > options_.max_squared_bias)
      return ProgressiveEnd::kTooBlurred;
    if (pass > 0 && begin_.Seconds() + last_pass_s_ > options_.time_limit_s)
      return ProgressiveEnd::kTimeLimit;
    return std::nullopt;
  }

  /// Makes the maps of a pass on another thread; chooses radii with the first.
  std::future<absl::StatusOr<PassMaps>> Make(std::uint64_t pass) {
    PassMapOptions make{
        .indirect_photons = options_.indirect_photons,
        .caustic_photons = options_.caustic_photons,
        .seed = PassSeed(options_.seed, pass),
        .upload = {.name = options_.map_name, .time_to_live = options_.time_to_live},
        .indirect = options_.indirect,
        .caustic = options_.caustic,
        .cancelled = [this, pass] { return stop_making_ || Interrupted() || TimeIsUp(pass); },
        .emitters = emitters_ ? &*emitters_ : options_.emitters};
    if (indirect_radius_) make.indirect.given = indirect_radius_;
    if (caustic_radius_) make.caustic.given = caustic_radius_;
    return std::async(std::launch::async, [this, make = std::move(make)] {
      return MakePassMaps(intersector_, client_, make);
    });
  }

  absl::Status RenderPass(std::uint64_t pass, const PassMaps& maps) {
    PassReport& report = result_.last;
    PhotonRenderOptions render = options_.pass;
    const auto shrink = [this](EstimateOptions& estimate, std::optional<float> radius) {
      if (!radius) return EstimateOptions{};
      estimate.radius = *radius;
      return estimate = Shrink(estimate, radius_.squared_scale());
    };
    report.indirect = shrink(render.indirect, indirect_radius_);
    report.caustic = shrink(render.caustic, caustic_radius_);
    const auto can_be_probed = [](const EstimateOptions& estimate) {
      return estimate.k == 0 || estimate.k >= kMinProbedNeighbors;
    };
    render.probe_radii = can_be_probed(report.indirect) && can_be_probed(report.caustic);
    render.camera.seed = PassSeed(options_.seed, pass);
    render.camera.final_gather_min_distance = report.indirect.radius;
    render.preview = pass == 0 ? options_.preview : PreviewOptions{};
    render.cancelled = [this, pass] { return Interrupted() || TimeIsUp(pass); };
    const auto picture = RenderPhotonMaps(intersector_, client_, maps.maps, render);
    if (!picture.ok()) return picture.status();

    statistics_.Add(picture->image, radius_.squared_scale(),
                    render.probe_radii ? &picture->radius_difference : nullptr);
    report.passes = statistics_.passes();
    report.photons += maps.photons;
    if (report.passes > 1) report.error = EstimateError();
    last_pass_s_ = begin_.Seconds() - std::exchange(report.seconds, begin_.Seconds());
    result_.photons_s += maps.seconds;
    result_.pictures_s += picture->seconds;
    preview_.Update([this] { return statistics_.Mean(); });
    return options_.pass_done ? options_.pass_done(report, statistics_) : absl::OkStatus();
  }

  ErrorEstimate EstimateError() const {
    ErrorEstimate error = statistics_.Estimate();
    const double known = options_.known_squared_bias * radius_.squared_scale();
    if (known <= 0) return error;
    const double passes = error.knows_bias ? static_cast<double>(statistics_.passes()) : 0;
    error.squared_bias =
        (kPassesOfKnownBias * known + passes * error.squared_bias) / (kPassesOfKnownBias + passes);
    error.knows_bias = true;
    return error;
  }

  void Delete(const PhotonMaps& maps) { result_.deleted.Update(DeleteMaps(client_, maps)); }

  void StopMaking() {
    stop_making_ = true;
    if (!next_.valid()) return;
    if (const auto unused = next_.get(); unused.ok()) Delete(unused->maps);
  }

  absl::StatusOr<ProgressiveResult> Finish(ProgressiveEnd end) {
    if (statistics_.passes() == 0)
      return absl::CancelledError(
          "interrupted before the first pass was done: there is no picture");
    StopMaking();
    result_.image = statistics_.Mean();
    result_.end = end;
    return std::move(result_);
  }

  /// Finishes where `status` is our own doing. Else the picture so far is shown before all that it
  /// took is lost.
  absl::StatusOr<ProgressiveResult> EndBy(const absl::Status& status) {
    if (absl::IsCancelled(status) && Interrupted()) return Finish(ProgressiveEnd::kInterrupted);
    if (absl::IsCancelled(status) && TimeIsUp(statistics_.passes()))
      return Finish(ProgressiveEnd::kTimeLimit);
    if (statistics_.passes() > 0 && options_.preview.show)
      options_.preview.show(statistics_.Mean());
    return status;
  }

  const Intersector& intersector_;
  PhotonMapClient& client_;
  const ProgressiveOptions& options_;
  const Stopwatch begin_;
  const std::optional<PhotonEmitters> emitters_;           // where options_ has none
  std::optional<float> indirect_radius_, caustic_radius_;  // of the first pass
  ShrinkingRadius radius_;
  PassStatistics statistics_;
  PreviewClock preview_;
  double last_pass_s_ = 0;
  ProgressiveResult result_;
  std::atomic<bool> stop_making_ = false;
  std::future<absl::StatusOr<PassMaps>> next_;
};

}  // namespace

absl::StatusOr<ProgressiveResult> RenderProgressively(const Intersector& intersector,
                                                      PhotonMapClient& client,
                                                      const ProgressiveOptions& options) {
  if (auto status = CheckOptions(options); !status.ok()) return status;
  return Run(intersector, client, options).Render();
}

}  // namespace treelight::client
