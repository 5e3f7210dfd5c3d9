#ifndef TREELIGHT_CLIENT_STUDY_STUDY_H_
#define TREELIGHT_CLIENT_STUDY_STUDY_H_

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/photon_map_client.h"
#include "client/study/study_row.h"

namespace treelight::client {

/// What the study measures. The defaults are the whole experiment.
struct StudyPlan {
  std::vector<std::string> scenes = {"sibenik", "dragon", "conference"};
  std::string scene_folder;  ///< as LoadStudyScene takes it
  std::uint32_t first_seed = 1, seeds = 5;
  std::uint32_t queries = 1000;  ///< searches in each tree
  /// Image photons of each of two cameras, with leaves of one photon; 0: none.
  std::uint64_t image_photons = 100'000;
  /// Light photons, with leaves of 8. From kManyPhotons on, fewer kinds of trees.
  std::vector<std::uint64_t> light_photons = {100'000, 1'000'000};
  /// Leaf sizes for which some kinds are measured over the smallest number of light photons.
  std::vector<std::uint32_t> leaf_sizes = {1, 2, 4, 8, 12, 16, 24, 32, 48};
  /// Photons of each input on which builders fail (hard_inputs.h), with leaves of 8; 0: none.
  std::uint64_t hard_photons = 20'000;
  bool few = false;  ///< fewer kinds of trees throughout
  /// Labels of the kinds of trees that are measured, the baseline with them; empty: all.
  std::vector<std::string> labels{};
  /// Gathers of a batch of light photons that is timed; 0: none. A GPU is busy with 100,000.
  std::uint32_t timed_gathers = 0;
};

inline constexpr std::uint64_t kManyPhotons = 1'000'000;

/// What the study tells while it runs.
struct StudyListener {
  std::function<absl::Status(const StudyRow& row)> row;  ///< in order; an error ends the study
  std::function<void(const std::string& line)> note;     ///< what to tell a person
};

/// The experiment of Bulavintsev and Zhdanov 2020 and what follows from it, on a server: photons of
/// each set are uploaded once, every tree is built from them by RebuildPhotonMap, judged by what
/// the server says of it and by searches (MeasureSearches), and deleted. All costs by isa, and all
/// builders that take a radius, have one radius: the median distance to the 50th photon around 101
/// photons of the set, which are not those of the searches.
///
/// Maps are named `study.N` with a random N, live an hour at most and are deleted at the end.
absl::Status RunStudy(PhotonMapClient& client, const StudyPlan& plan,
                      const StudyListener& listener);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_STUDY_STUDY_H_
