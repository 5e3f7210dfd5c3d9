#include "client/render/progressive_renderer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>
#include <utility>

#include "client/render/map_upload.h"
#include "client/render/shrinking_radius.h"
#include "client/trace/photon_tracer.h"
#include "client/trace/random.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

using Clock = std::chrono::steady_clock;

/// The fewest neighbours of an estimate that is probed: a quarter of them still tells something.
constexpr std::uint32_t kMinProbedNeighbors = 12;

double SecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// The maps of one pass.
struct PassMaps {
  PhotonMaps maps;
  std::uint64_t photons = 0;
  std::optional<float> indirect_radius, caustic_radius;  // of the first pass; nothing: no map yet
  double seconds = 0;
};

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
        statistics_(options.pass.width, options.pass.height),
        preview_(options.preview) {}

  ~Run() { StopMaking(); }

  absl::StatusOr<ProgressiveResult> Render() {
    next_ = Make(0);
    for (std::uint64_t pass = 0;; ++pass) {
      if (const auto end = EndBefore(pass)) return Finish(*end);
      const auto waiting = Clock::now();
      const auto maps = next_.get();
      result_.waited_s += SecondsSince(waiting);
      if (!maps.ok()) return EndBy(maps.status());
      indirect_radius_ = maps->indirect_radius, caustic_radius_ = maps->caustic_radius;
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
    return pass > 0 && SecondsSince(begin_) > options_.time_limit_s;
  }

  /// Why pass `pass` is not begun; nothing: it is.
  std::optional<ProgressiveEnd> EndBefore(std::uint64_t pass) const {
    if (Interrupted()) return ProgressiveEnd::kInterrupted;
    const PassReport& last = result_.last;
    if (pass >= kMinPassesOfTarget && last.error->relative_rms() <= options_.target_error)
      return ProgressiveEnd::kTargetError;
    if (pass == options_.max_passes) return ProgressiveEnd::kPasses;
    if (pass > 0 && SecondsSince(begin_) + last_pass_s_ > options_.time_limit_s)
      return ProgressiveEnd::kTimeLimit;
    return std::nullopt;
  }

  /// Traces and uploads the photons of a pass on another thread; chooses radii with the first maps.
  std::future<absl::StatusOr<PassMaps>> Make(std::uint64_t pass) {
    return std::async(std::launch::async, [this, pass, indirect_radius = indirect_radius_,
                                           caustic_radius = caustic_radius_] {
      return MakeMaps(pass, indirect_radius, caustic_radius);
    });
  }

  absl::StatusOr<PassMaps> MakeMaps(std::uint64_t pass, std::optional<float> indirect_radius,
                                    std::optional<float> caustic_radius) {
    const auto begin = Clock::now();
    const auto photons = TracePhotons(
        intersector_,
        {.indirect_photons = options_.indirect_photons,
         .caustic_photons = options_.caustic_photons,
         .seed = PassSeed(options_.seed, pass),
         .cancelled = [this, pass] { return stop_making_ || Interrupted() || TimeIsUp(pass); }});
    if (!photons.ok()) return photons.status();
    const auto uploaded = UploadMaps(
        client_, *photons, {.name = options_.map_name, .time_to_live = options_.time_to_live});
    if (!uploaded.ok()) return uploaded.status();
    PassMaps maps{.maps = uploaded->refs(),
                  .photons = photons->indirect.size() + photons->caustic.size(),
                  .indirect_radius = indirect_radius,
                  .caustic_radius = caustic_radius};
    auto status =
        Choose(maps.maps.indirect, photons->indirect, options_.indirect, maps.indirect_radius);
    if (status.ok()) {
      status = Choose(maps.maps.caustic, photons->caustic, options_.caustic, maps.caustic_radius);
    }
    if (!status.ok()) {
      DeleteMaps(client_, maps.maps).IgnoreError();  // the first error tells more
      return status;
    }
    maps.seconds = SecondsSince(begin);
    return maps;
  }

  absl::Status Choose(const std::optional<MapRef>& map, const Photons& photons,
                      const FirstRadius& first, std::optional<float>& radius) {
    if (radius || !map) return absl::OkStatus();
    radius = first.given;
    if (radius) return absl::OkStatus();
    const auto k = static_cast<std::uint32_t>(std::min<std::size_t>(first.k, photons.size()));
    const auto chosen = RadiusOfNearest(client_, *map, photons, k, first.quantile);
    if (chosen.ok()) radius = *chosen;
    return chosen.status();
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
    if (report.passes > 1) report.error = statistics_.Estimate();
    last_pass_s_ = SecondsSince(begin_) - std::exchange(report.seconds, SecondsSince(begin_));
    result_.photons_s += maps.seconds;
    result_.pictures_s += picture->seconds;
    preview_.Update([this] { return statistics_.Mean(); });
    return options_.pass_done ? options_.pass_done(report, statistics_) : absl::OkStatus();
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
  const Clock::time_point begin_ = Clock::now();
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
