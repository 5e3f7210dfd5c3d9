#include "client/study/study.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <limits>
#include <optional>
#include <random>
#include <utility>

#include "client/remote_map.h"
#include "client/render/image_photons.h"
#include "client/study/hard_inputs.h"
#include "client/study/sample.h"
#include "client/study/study_scene.h"
#include "client/trace/photon_tracer.h"
#include "core/builder.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::uint32_t kImageLeafSize = 1, kLightLeafSize = 8;
constexpr std::uint32_t kRadiusQueries = 101, kCheckedQueries = 100, kNeighbors = 50;
constexpr std::array<const char*, 2> kCameraNames = {"front", "back"};

/// Seeds of choices, so that no two are the same choice.
enum Choice : std::uint64_t {
  kSearches = 0x5eed'0000,
  kRadii = 0x5eed'1000,
  kHard = 0x5eed'2000,
  kTimed = 0x5eed'3000
};

/// What trees are built from one set of photons.
struct Trees {
  VariantChoice variants;
  std::uint32_t leaf_size;
};

double BuildMs(const v1::PhotonMap& map) {
  double microseconds = 0;
  for (const v1::StageTime& stage : map.build_stages()) {
    if (stage.stage() != "upload") microseconds += stage.microseconds();
  }
  return 1e-3 * microseconds;
}

/// One set of photons on the server, and what its trees are asked.
class PhotonSetStudy {
 public:
  PhotonSetStudy(PhotonMapClient& client, const StudyListener& listener, PhotonSetName name,
                 const StudyPlan& plan)
      : client_(client),
        listener_(listener),
        name_(std::move(name)),
        plan_(plan),
        map_name_(
            fmt::format("study.{:08x}{:08x}", std::random_device{}(), std::random_device{}())) {}

  ~PhotonSetStudy() {
    if (uploaded_) client_.DeletePhotonMap({.name = map_name_}).status().IgnoreError();
  }
  PhotonSetStudy(const PhotonSetStudy&) = delete;
  PhotonSetStudy& operator=(const PhotonSetStudy&) = delete;

  /// Uploads `photons` and chooses searches and radius. Gathers are timed where there are powers.
  absl::Status Upload(const Photons& photons) {
    name_.photons = photons.size();
    queries_ = SamplePositions(photons.positions, plan_.queries, kSearches + name_.seed);
    const auto radius_queries =
        SamplePositions(photons.positions, kRadiusQueries, kRadii + name_.seed);
    const auto source =
        client_.BuildPhotonMap(map_name_, photons, {.time_to_live = std::chrono::hours(1)});
    if (!source.ok()) return source.status();
    uploaded_ = true;
    const auto radii = client_.Gather({.name = map_name_}, {.positions = radius_queries},
                                      {.k = kNeighbors, .outputs = kOutputRadius});
    if (!radii.ok()) return radii.status();
    radius_ = Median(radii->result.radii);
    if (!photons.powers.empty() && plan_.timed_gathers > 0) {
      timed_queries_ = SamplePositions(photons.positions, plan_.timed_gathers, kTimed + name_.seed);
      auto distances = client_.Gather({.name = map_name_}, {.positions = timed_queries_},
                                      {.k = kNeighbors, .outputs = kOutputRadius});
      if (!distances.ok()) return distances.status();
      timed_radii_ = std::move(distances->result.radii);
    }
    return ComputeTrueAnswers(photons);
  }

  /// Builds and judges.
  absl::Status Measure(const Trees& trees) {
    for (const Variant& variant : StudyVariants(trees.variants, trees.leaf_size)) {
      if (!IsWanted(variant)) continue;
      auto row = MeasureOne(variant, trees.leaf_size);
      if (!row.ok()) {
        return {row.status().code(),
                fmt::format("{} {} {}: {}", name_.scene, name_.set, Label(variant),
                            std::string(row.status().message()))};
      }
      if (auto status = listener_.row(*row); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

 private:
  bool IsWanted(const Variant& variant) const {
    const std::vector<std::string>& labels = plan_.labels;
    return labels.empty() || IsBaseline(variant) ||
           std::find(labels.begin(), labels.end(), Label(variant)) != labels.end();
  }

  /// The middle one of those that are more than 0 and finite; 0 where there is none.
  static float Median(std::vector<float> radii) {
    std::erase_if(radii, [](float radius) {
      return !(radius > 0) || radius == std::numeric_limits<float>::infinity();
    });
    if (radii.empty()) return 0;
    const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
    std::nth_element(radii.begin(), middle, radii.end());
    return *middle;
  }

  /// What brute force answers to the first searches: no tree may answer anything else.
  absl::Status ComputeTrueAnswers(const Photons& photons) {
    checked_ =
        std::span(queries_).first(std::min(queries_.size(), std::size_t{3} * kCheckedQueries));
    const auto map = MakeBruteForceBuilder()->Build(photons, {});
    if (!map.ok()) return map.status();
    auto answer = (*map)->Gather({.positions = checked_}, AskedForCheck());
    if (!answer.ok()) return answer.status();
    truth_ = *std::move(answer);
    return absl::OkStatus();
  }

  static GatherOptions AskedForCheck() {
    return {.k = kNeighbors, .outputs = kOutputCount | kOutputRadius | kOutputNeighbors};
  }

  absl::Status CheckAnswers(const Gatherer& map) const {
    const auto answer = map.Gather({.positions = checked_}, AskedForCheck());
    if (!answer.ok()) return answer.status();
    if (answer->counts == truth_.counts && answer->radii == truth_.radii &&
        answer->neighbor_ids == truth_.neighbor_ids &&
        answer->neighbor_squared_distances == truth_.neighbor_squared_distances) {
      return absl::OkStatus();
    }
    return absl::InternalError("an answer differs from that of brute force");
  }

  /// Kernel time of one of the timed gathers, the least of three batches, ns; 0 where there are
  /// none.
  absl::StatusOr<double> TimeGathers(const MapRef& map, const GatherOptions& options,
                                     std::span<const float> radii) {
    if (timed_queries_.empty()) return 0.0;
    double least_us = std::numeric_limits<double>::infinity();
    for (int repeat = 0; repeat < 3; ++repeat) {
      const auto answer =
          client_.Gather(map, {.positions = timed_queries_, .radii = radii}, options);
      if (!answer.ok()) return answer.status();
      least_us = std::min(least_us, answer->timings.kernel_us());
    }
    return 1e3 * least_us / plan_.timed_gathers;
  }

  absl::StatusOr<StudyRow> MeasureOne(const Variant& variant, std::uint32_t leaf_size) {
    const auto built = client_.RebuildPhotonMap(
        {.name = map_name_, .version = 1},
        {.build = OptionsOf(variant, leaf_size, radius_), .time_to_live = std::chrono::hours(1)});
    if (!built.ok()) return built.status();
    const v1::PhotonMap& map = built->map();
    const RemoteMap remote(client_, map);
    auto searches = MeasureSearches(remote, queries_);
    if (!searches.ok()) return searches.status();
    if (auto status = CheckAnswers(remote); !status.ok()) return status;
    const MapRef version{.name = map_name_, .version = map.version()};
    const auto knn50_ns = TimeGathers(version, {.k = kNeighbors, .outputs = kOutputDensity}, {});
    if (!knn50_ns.ok()) return knn50_ns.status();
    const auto r50_ns = TimeGathers(version, {.k = 0, .outputs = kOutputDensity}, timed_radii_);
    if (!r50_ns.ok()) return r50_ns.status();
    const auto deleted = client_.DeletePhotonMap({.name = map_name_, .version = map.version()});
    if (!deleted.ok()) return deleted.status();
    return StudyRow{.photons = name_,
                    .variant = variant,
                    .leaf_size = leaf_size,
                    .sah_cost = map.statistics().sah_cost(),
                    .isa_cost = map.statistics().isa_cost(),
                    .depth = map.statistics().depth(),
                    .leaf_fill = map.statistics().leaf_fill(),
                    .searches = *searches,
                    .build_ms = BuildMs(map),
                    .device = map.device(),
                    .knn50_ns = *knn50_ns,
                    .r50_ns = *r50_ns};
  }

  PhotonMapClient& client_;
  const StudyListener& listener_;
  PhotonSetName name_;
  const StudyPlan& plan_;
  const std::string map_name_;
  bool uploaded_ = false;
  std::vector<float> queries_;  // [3m]
  std::vector<float> timed_queries_, timed_radii_;
  std::span<const float> checked_;
  GatherResult truth_;
  float radius_ = 0;
};

Photons PositionsAlone(std::vector<float> positions) {
  return {.positions = std::move(positions), .powers = {}, .directions = {}};
}

/// Photons of one set.
absl::StatusOr<Photons> TraceLightPhotons(const Intersector& intersector, std::uint64_t count,
                                          std::uint32_t seed) {
  auto traced =
      TracePhotons(intersector, {.indirect_photons = count, .caustic_photons = 0, .seed = seed});
  if (!traced.ok()) return traced.status();
  Photons& photons = traced->indirect;
  if (photons.size() < count) {
    return absl::FailedPreconditionError(
        fmt::format("{} light photons were traced, {} are wanted", photons.size(), count));
  }
  photons.positions.resize(3 * count);  // the last path may have brought a few more
  photons.powers.resize(3 * count);
  photons.directions.clear();
  return std::move(photons);
}

absl::StatusOr<Photons> TraceCameraPhotons(const Intersector& intersector, std::uint64_t count,
                                           std::uint32_t seed) {
  // Each path brings about two; choose among four times as many as are taken.
  const auto per_pixel = static_cast<std::uint32_t>(1 + 2 * count / (512 * 512));
  auto traced = TraceImagePhotons(intersector,
                                  {.count = count, .samples_per_pixel = per_pixel, .seed = seed});
  if (!traced.ok()) return traced.status();
  return PositionsAlone(std::move(traced->positions));
}

/// Runs the sets of one scene.
class SceneStudy {
 public:
  SceneStudy(PhotonMapClient& client, const StudyPlan& plan, const StudyListener& listener)
      : client_(client), plan_(plan), listener_(listener) {}

  absl::Status Run(const std::string& scene_name) {
    auto study = LoadStudyScene(scene_name, plan_.scene_folder);
    if (!study.ok()) return study.status();
    if (!study->note.empty()) listener_.note(study->note);
    name_ = study->name;
    for (std::size_t camera = 0; camera < study->cameras.size(); ++camera) {
      study->scene.camera = study->cameras[camera];
      const bool wants_light = camera == 0 && !plan_.light_photons.empty();
      if (plan_.image_photons == 0 && !wants_light) continue;
      const auto intersector = Intersector::Create(study->scene);
      if (!intersector.ok()) return intersector.status();
      for (std::uint32_t seed = plan_.first_seed; seed < plan_.first_seed + plan_.seeds; ++seed) {
        if (auto status = RunImage(*intersector, camera, seed); !status.ok()) return status;
        if (!wants_light) continue;
        if (auto status = RunLight(*intersector, seed); !status.ok()) return status;
      }
    }
    return absl::OkStatus();
  }

 private:
  VariantChoice Choice(std::uint64_t photons) const {
    return plan_.few || photons >= kManyPhotons ? VariantChoice::kFew : VariantChoice::kAll;
  }

  absl::Status RunImage(const Intersector& intersector, std::size_t camera, std::uint32_t seed) {
    if (plan_.image_photons == 0) return absl::OkStatus();
    auto photons = TraceCameraPhotons(intersector, plan_.image_photons, seed);
    if (!photons.ok()) return photons.status();
    return Measure({.scene = name_, .set = "image", .camera = kCameraNames[camera], .seed = seed},
                   *photons, {{Choice(plan_.image_photons), kImageLeafSize}});
  }

  absl::Status RunLight(const Intersector& intersector, std::uint32_t seed) {
    for (const std::uint64_t count : plan_.light_photons) {
      auto photons = TraceLightPhotons(intersector, count, seed);
      if (!photons.ok()) return photons.status();
      std::vector<Trees> trees = {{Choice(count), kLightLeafSize}};
      if (count == plan_.light_photons.front()) {
        for (const std::uint32_t leaf_size : plan_.leaf_sizes) {
          if (leaf_size != kLightLeafSize) trees.push_back({VariantChoice::kCurve, leaf_size});
        }
      }
      if (auto status = Measure({.scene = name_, .set = "light", .camera = {}, .seed = seed},
                                *photons, trees);
          !status.ok()) {
        return status;
      }
    }
    return absl::OkStatus();
  }

  absl::Status Measure(const PhotonSetName& name, const Photons& photons,
                       const std::vector<Trees>& trees) {
    PhotonSetStudy study(client_, listener_, name, plan_);
    if (auto status = study.Upload(photons); !status.ok()) return status;
    for (const Trees& wanted : trees) {
      if (auto status = study.Measure(wanted); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

  PhotonMapClient& client_;
  const StudyPlan& plan_;
  const StudyListener& listener_;
  std::string name_;
};

absl::Status RunHardInputs(PhotonMapClient& client, const StudyPlan& plan,
                           const StudyListener& listener) {
  for (HardInput& input : MakeHardInputs(plan.hard_photons, kHard + plan.first_seed)) {
    PhotonSetStudy study(
        client, listener,
        {.scene = input.name, .set = "hard", .camera = {}, .seed = plan.first_seed}, plan);
    const absl::Status uploaded = study.Upload(PositionsAlone(std::move(input.positions)));
    if (absl::IsInvalidArgument(uploaded)) {
      listener.note(fmt::format("{}: refused: {}", input.name, std::string(uploaded.message())));
      continue;
    }
    if (!uploaded.ok()) return uploaded;
    const auto variants = plan.few ? VariantChoice::kFew : VariantChoice::kAll;
    if (auto status = study.Measure({variants, kLightLeafSize}); !status.ok()) return status;
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status RunStudy(PhotonMapClient& client, const StudyPlan& plan,
                      const StudyListener& listener) {
  for (const std::string& scene : plan.scenes) {
    if (auto status = SceneStudy(client, plan, listener).Run(scene); !status.ok()) return status;
  }
  if (plan.hard_photons == 0) return absl::OkStatus();
  return RunHardInputs(client, plan, listener);
}

}  // namespace treelight::client
