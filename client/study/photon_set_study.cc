#include "client/study/photon_set_study.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <random>
#include <utility>

#include "client/remote_map.h"
#include "client/study/sample.h"
#include "core/builder.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::uint32_t kRadiusQueries = 101, kCheckedQueries = 100, kNeighbors = 50;

double BuildMs(const v1::PhotonMap& map) {
  double microseconds = 0;
  for (const v1::StageTime& stage : map.build_stages()) {
    if (stage.stage() != "upload") microseconds += stage.microseconds();
  }
  return 1e-3 * microseconds;
}

/// The middle one of those that are more than 0 and finite; 0 where there is none.
float Median(std::vector<float> radii) {
  std::erase_if(radii, [](float radius) {
    return !(radius > 0) || radius == std::numeric_limits<float>::infinity();
  });
  if (radii.empty()) return 0;
  const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
  std::nth_element(radii.begin(), middle, radii.end());
  return *middle;
}

GatherOptions AskedForCheck() {
  return {.k = kNeighbors, .outputs = kOutputCount | kOutputRadius | kOutputNeighbors};
}

}  // namespace

PhotonSetStudy::PhotonSetStudy(PhotonMapClient& client, const StudyListener& listener,
                               PhotonSetName name, const StudyPlan& plan)
    : client_(client),
      listener_(listener),
      name_(std::move(name)),
      plan_(plan),
      map_name_(fmt::format("study.{:08x}{:08x}", std::random_device{}(), std::random_device{}())) {
}

PhotonSetStudy::~PhotonSetStudy() {
  if (uploaded_) client_.DeletePhotonMap({.name = map_name_}).status().IgnoreError();
}

absl::Status PhotonSetStudy::Upload(const Photons& photons) {
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
  if (auto status = ChooseTimedGathers(photons); !status.ok()) return status;
  return ComputeTrueAnswers(photons);
}

absl::Status PhotonSetStudy::ChooseTimedGathers(const Photons& photons) {
  if (photons.powers.empty() || plan_.timed_gathers == 0) return absl::OkStatus();
  timed_queries_ = SamplePositions(photons.positions, plan_.timed_gathers, kTimed + name_.seed);
  auto distances = client_.Gather({.name = map_name_}, {.positions = timed_queries_},
                                  {.k = kNeighbors, .outputs = kOutputRadius});
  if (!distances.ok()) return distances.status();
  timed_radii_ = std::move(distances->result.radii);
  return absl::OkStatus();
}

absl::Status PhotonSetStudy::Measure(const Trees& trees) {
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

bool PhotonSetStudy::IsWanted(const Variant& variant) const {
  const std::vector<std::string>& labels = plan_.labels;
  return labels.empty() || IsBaseline(variant) ||
         std::find(labels.begin(), labels.end(), Label(variant)) != labels.end();
}

absl::Status PhotonSetStudy::ComputeTrueAnswers(const Photons& photons) {
  checked_ = std::span(queries_).first(std::min(queries_.size(), std::size_t{3} * kCheckedQueries));
  const auto map = MakeBruteForceBuilder()->Build(photons, {});
  if (!map.ok()) return map.status();
  auto answer = (*map)->Gather({.positions = checked_}, AskedForCheck());
  if (!answer.ok()) return answer.status();
  truth_ = *std::move(answer);
  return absl::OkStatus();
}

/// No tree may answer anything else.
absl::Status PhotonSetStudy::CheckAnswers(const Gatherer& map) const {
  const auto answer = map.Gather({.positions = checked_}, AskedForCheck());
  if (!answer.ok()) return answer.status();
  if (answer->counts == truth_.counts && answer->radii == truth_.radii &&
      answer->neighbor_ids == truth_.neighbor_ids &&
      answer->neighbor_squared_distances == truth_.neighbor_squared_distances) {
    return absl::OkStatus();
  }
  return absl::InternalError("an answer differs from that of brute force");
}

/// Kernel time of one of the timed gathers, the least of three batches, ns; 0 where there are none.
absl::StatusOr<double> PhotonSetStudy::TimeGathers(const MapRef& map, const GatherOptions& options,
                                                   std::span<const float> radii) {
  if (timed_queries_.empty()) return 0.0;
  double least_us = std::numeric_limits<double>::infinity();
  for (int repeat = 0; repeat < 3; ++repeat) {
    const auto answer = client_.Gather(map, {.positions = timed_queries_, .radii = radii}, options);
    if (!answer.ok()) return answer.status();
    least_us = std::min(least_us, answer->timings.kernel_us());
  }
  return 1e3 * least_us / plan_.timed_gathers;
}

absl::StatusOr<StudyRow> PhotonSetStudy::MeasureOne(const Variant& variant,
                                                    std::uint32_t leaf_size) {
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

}  // namespace treelight::client
