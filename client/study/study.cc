#include "client/study/study.h"

#include <algorithm>
#include <array>
#include <utility>

#include "client/render/image_photons.h"
#include "client/study/hard_inputs.h"
#include "client/study/photon_set_study.h"
#include "client/study/study_scene.h"
#include "client/trace/photon_tracer.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::uint32_t kImageLeafSize = 1, kLightLeafSize = 8;
constexpr std::array<const char*, 2> kCameraNames = {"front", "back"};

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
  // At least two paths for each photon that is taken: some meet nothing.
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
      if (count == *std::min_element(plan_.light_photons.begin(), plan_.light_photons.end())) {
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
