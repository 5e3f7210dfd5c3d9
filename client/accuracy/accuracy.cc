#include "client/accuracy/accuracy.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <map>
#include <optional>
#include <random>
#include <span>
#include <utility>

#include "client/accuracy/truth.h"
#include "client/render/camera_pass.h"
#include "client/render/gather_radius.h"
#include "client/render/map_upload.h"
#include "client/render/path_tracer.h"
#include "client/render/photon_renderer.h"
#include "client/study/sample.h"
#include "client/trace/photon_tracer.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::hours kTimeToLive{1};
constexpr float kUnlimited = std::numeric_limits<float>::infinity();

/// Where gathers are asked for.
struct Points {
  std::vector<float> positions, normals;  ///< [3m] each, or no normals
  GatherQueries view() const { return {.positions = positions, .normals = normals, .radii = {}}; }
};

/// What the camera sees, by one sample of each of 512 x 512 pixels.
GatherPoints VisiblePoints(const Intersector& scene, std::uint64_t seed) {
  constexpr int kSize = 512;
  const CameraRays camera(scene.scene().camera, kSize, kSize);
  const SampleOrder order(kSize, kSize, /*samples_per_pixel=*/1);
  return TraceCameraBatch(scene, Lights(scene.scene()), camera, order, 0, order.size(),
                          {.samples_per_pixel = 1, .light_strata = 1, .seed = seed})
      .diffuse_hits;
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// One scene on the server. Deletes its maps at the end.
class SceneMeasurement {
 public:
  SceneMeasurement(PhotonMapClient& client, const AccuracyPlan& plan,
                   const AccuracyListener& listener, const Intersector& scene)
      : client_(client),
        plan_(plan),
        listener_(listener),
        scene_(scene),
        map_name_(
            fmt::format("accuracy.{:08x}{:08x}", std::random_device{}(), std::random_device{}())) {}

  ~SceneMeasurement() {
    if (map_.version > 0) (void)client_.DeletePhotonMap(map_);
    if (pictures_) (void)DeleteMaps(client_, *pictures_);
  }
  SceneMeasurement(const SceneMeasurement&) = delete;
  SceneMeasurement& operator=(const SceneMeasurement&) = delete;

  absl::Status Run() {
    if (auto status = Prepare(); !status.ok()) return status;
    for (const Setting& setting : SettingGrid(plan_.ks, plan_.errors)) {
      if (setting.k > photons_.indirect.size()) continue;
      if (plan_.normals && setting.knob == Knob::kWeightTolerance) continue;  // goes without only
      auto row = Measure(setting);
      if (!row.ok()) return row.status();
      if (auto status = listener_(*row); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

 private:
  absl::Status Prepare() {
    auto traced = TracePhotons(scene_, {.indirect_photons = plan_.photons,
                                        .caustic_photons = plan_.caustic_photons,
                                        .seed = plan_.seed});
    if (!traced.ok()) return traced.status();
    photons_ = *std::move(traced);
    if (plan_.normals) visible_ = VisiblePoints(scene_, plan_.seed);
    if (plan_.normals && visible_.size() == 0) {
      return absl::FailedPreconditionError("the camera sees nothing that light is gathered at");
    }
    queries_ = Sample(plan_.queries, plan_.seed);
    const auto built =
        client_.BuildPhotonMap(map_name_, photons_.indirect, {.time_to_live = kTimeToLive});
    if (!built.ok()) return built.status();
    device_ = built->map().device();
    map_ = {.name = built->map().name(), .version = built->map().version()};
    if (plan_.picture_size == 0) return absl::OkStatus();
    const auto uploaded =
        UploadMaps(client_, photons_, {.name = map_name_, .time_to_live = kTimeToLive});
    if (!uploaded.ok()) return uploaded.status();
    pictures_ = uploaded->refs();
    const auto reference = PathTrace(scene_, {.width = plan_.picture_size,
                                              .height = plan_.picture_size,
                                              .samples_per_pixel = plan_.reference_spp,
                                              .seed = plan_.seed});
    if (!reference.ok()) return reference.status();
    reference_ = *reference;
    return absl::OkStatus();
  }

  /// The same queries for the same seed.
  Points Sample(std::uint32_t count, std::uint64_t seed) const {
    if (!plan_.normals) return {SamplePositions(photons_.indirect.positions, count, seed), {}};
    return {SamplePositions(visible_.positions, count, seed),
            SamplePositions(visible_.normals, count, seed)};
  }

  /// The radius that holds k photons around half of the photons.
  absl::StatusOr<float> RadiusOf(std::uint32_t k) {
    auto& radius = radii_[k];
    if (!radius) {
      const auto found = RadiusOfNearest(client_, map_, photons_.indirect, k, /*quantile=*/0.5);
      if (!found.ok()) return found.status();
      radius = *found;
    }
    return *radius;
  }

  absl::StatusOr<AccuracyRow> Measure(const Setting& setting) {
    AccuracyRow row{.scene = scene_.scene().name,
                    .photons = photons_.indirect.size(),
                    .seed = plan_.seed,
                    .device = device_,
                    .setting = setting,
                    .radius = kUnlimited,
                    .queries = plan_.queries,
                    .checked = std::min(plan_.checked, plan_.queries),
                    .normals = plan_.normals};
    GatherOptions options = OptionsOf(setting);
    if (IsWithinRadius(setting.knob)) {
      const auto radius = RadiusOf(setting.k);
      if (!radius.ok()) return radius.status();
      options.radius = row.radius = *radius;
    }
    const auto speed = Time(options, WireOf(setting), row.merge);
    if (!speed.ok()) return speed.status();
    row.speed = *speed;
    if (AsksForError(setting.knob)) {
      if (auto status = CountWithin(options, row.merge); !status.ok()) return status;
    }
    const auto error = Judge(setting, options);
    if (!error.ok()) return error.status();
    row.error = *error;
    const bool has_picture = setting.knob == Knob::kNone || setting.knob == Knob::kEpsilon ||
                             setting.knob == Knob::kMaxLeaves || setting.knob == Knob::kError;
    if (!has_picture || !pictures_) return row;
    const auto picture = Render(options);
    if (!picture.ok()) return picture.status();
    row.picture = *picture;
    return row;
  }

  absl::StatusOr<AnswerSpeed> Time(const GatherOptions& options, const WireOptions& wire,
                                   ChosenMerge& merge) {
    AnswerSpeed speed;
    std::vector<double> kernel, whole;
    const double count = plan_.queries;
    for (std::uint32_t run = 0; run <= plan_.runs; ++run) {
      const auto begin = Clock::now();
      const auto answer = client_.Gather(map_, queries_.view(), options, wire);
      const std::chrono::duration<double, std::nano> took = Clock::now() - begin;
      if (!answer.ok()) return answer.status();
      const v1::MergeReport& report = answer->merge_report;
      merge.merged_photons = std::max(report.merged_photons(), report.thinned_photons());
      merge.measured_error = report.measured_error();
      speed.request_bytes = static_cast<double>(answer->wire.request_bytes) / count;
      speed.answer_bytes = static_cast<double>(answer->wire.answer_bytes) / count;
      if (run == 0) continue;  // compiles, fills caches
      kernel.push_back(1e3 * answer->timings.kernel_us() / count);
      whole.push_back(took.count() / count);
    }
    speed.kernel_ns = Median(kernel);
    speed.whole_ns = Median(whole);
    return speed;
  }

  /// How many of further batches keep the error that they ask for, beside exact answers.
  absl::Status CountWithin(const GatherOptions& options, ChosenMerge& merge) {
    GatherOptions exactly = options;
    exactly.approximation = {};
    for (std::uint32_t batch = 1; batch <= plan_.batches; ++batch) {
      const Points queries = Sample(plan_.batch_queries, plan_.seed + batch);
      const auto exact = client_.Gather(map_, queries.view(), exactly);
      if (!exact.ok()) return exact.status();
      const auto answer = client_.Gather(map_, queries.view(), options);
      if (!answer.ok()) return answer.status();
      const double error = DensityError(answer->result, exact->result);
      ++merge.batches;
      if (error <= options.approximation.max_relative_error) ++merge.batches_within;
    }
    return absl::OkStatus();
  }

  absl::StatusOr<AnswerError> Judge(const Setting& setting, GatherOptions options) {
    const std::size_t numbers = 3 * std::size_t{std::min(plan_.checked, plan_.queries)};
    GatherQueries checked = queries_.view();
    checked.positions = checked.positions.first(numbers);
    if (plan_.normals) checked.normals = checked.normals.first(numbers);
    const bool within = IsWithinRadius(setting.knob);
    auto& truth = truths_[{within, setting.k}];
    if (truth.empty()) {
      truth = ComputeTruth(photons_.indirect, checked, within ? 0 : setting.k, options.radius);
    }
    options.outputs |= kOutputRadius;
    const bool merges = options.approximation.merges();
    if (!within && !merges) options.outputs |= kOutputNeighbors;
    if (options.approximation.any()) options.outputs |= kOutputErrorBound;
    // A choice is that of the whole batch.
    const auto answer =
        client_.Gather(map_, merges ? queries_.view() : checked, options, WireOf(setting));
    if (!answer.ok()) return answer.status();
    return CompareAnswers(photons_.indirect, queries_.positions, answer->result, truth, options.k);
  }

  absl::StatusOr<PictureError> Render(const GatherOptions& gather) {
    PhotonRenderOptions options{.width = plan_.picture_size, .height = plan_.picture_size};
    const auto radius = RadiusOfNearest(client_, *pictures_->indirect, photons_.indirect, gather.k,
                                        kIndirectRadiusQuantile);
    if (!radius.ok()) return radius.status();
    options.indirect = {.k = gather.k, .radius = *radius, .approximation = gather.approximation};
    if (pictures_->caustic) {
      const auto caustic_k = static_cast<std::uint32_t>(
          std::min<std::size_t>(options.caustic.k, photons_.caustic.size()));
      const auto caustic = RadiusOfNearest(client_, *pictures_->caustic, photons_.caustic,
                                           caustic_k, kCausticRadiusQuantile);
      if (!caustic.ok()) return caustic.status();
      options.caustic.radius = *caustic;
    }
    const auto picture = RenderPhotonMaps(scene_, client_, *pictures_, options);
    if (!picture.ok()) return picture.status();
    const auto error = Compare(picture->image, reference_.image);
    if (!error.ok()) return error.status();
    return PictureError{.rmse = error->rmse,
                        .relative_mse = error->relative_mse,
                        .seconds = picture->seconds,
                        .reference_noise = reference_.noise};
  }

  PhotonMapClient& client_;
  const AccuracyPlan& plan_;
  const AccuracyListener& listener_;
  const Intersector& scene_;
  const std::string map_name_;
  std::string device_;
  TracedPhotons photons_;
  GatherPoints visible_;  // none without normals
  Points queries_;
  MapRef map_;
  std::map<std::uint32_t, std::optional<float>> radii_;
  std::map<std::pair<bool, std::uint32_t>, std::vector<TrueAnswer>> truths_;
  std::optional<PhotonMaps> pictures_;
  PathTracedImage reference_;
};

}  // namespace

absl::Status MeasureAccuracy(PhotonMapClient& client, Scene scene, const AccuracyPlan& plan,
                             const AccuracyListener& listener) {
  const auto intersector = Intersector::Create(std::move(scene));
  if (!intersector.ok()) return intersector.status();
  return SceneMeasurement(client, plan, listener, *intersector).Run();
}

}  // namespace treelight::client
