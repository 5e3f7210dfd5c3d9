#ifndef TREELIGHT_CLIENT_STUDY_PHOTON_SET_STUDY_H_
#define TREELIGHT_CLIENT_STUDY_PHOTON_SET_STUDY_H_

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/photon_map_client.h"
#include "client/study/study.h"
#include "client/study/study_row.h"
#include "client/study/variant.h"

namespace treelight::client {

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

/// One set of photons on the server, and what its trees are asked. Deletes its maps at the end.
class PhotonSetStudy {
 public:
  /// `client`, `listener` and `plan` outlive it.
  PhotonSetStudy(PhotonMapClient& client, const StudyListener& listener, PhotonSetName name,
                 const StudyPlan& plan);
  ~PhotonSetStudy();
  PhotonSetStudy(const PhotonSetStudy&) = delete;
  PhotonSetStudy& operator=(const PhotonSetStudy&) = delete;

  /// Uploads `photons` and chooses searches and radius. Gathers are timed where there are powers.
  absl::Status Upload(const Photons& photons);

  /// Builds and judges; tells the listener.
  absl::Status Measure(const Trees& trees);

 private:
  bool IsWanted(const Variant& variant) const;
  absl::Status ChooseTimedGathers(const Photons& photons);
  absl::Status ComputeTrueAnswers(const Photons& photons);
  absl::Status CheckAnswers(const Gatherer& map) const;
  absl::StatusOr<double> TimeGathers(const MapRef& map, const GatherOptions& options,
                                     std::span<const float> radii);
  absl::StatusOr<StudyRow> MeasureOne(const Variant& variant, std::uint32_t leaf_size);

  PhotonMapClient& client_;
  const StudyListener& listener_;
  PhotonSetName name_;
  const StudyPlan& plan_;
  const std::string map_name_;
  bool uploaded_ = false;
  std::vector<float> queries_;  // [3m]
  std::vector<float> timed_queries_, timed_radii_;
  std::span<const float> checked_;  // the first of queries_
  GatherResult truth_;              // what brute force answers to them
  float radius_ = 0;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_STUDY_PHOTON_SET_STUDY_H_
