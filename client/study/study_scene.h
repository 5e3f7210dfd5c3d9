#ifndef TREELIGHT_CLIENT_STUDY_STUDY_SCENE_H_
#define TREELIGHT_CLIENT_STUDY_STUDY_SCENE_H_

#include <array>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/scenes/scene.h"

namespace treelight::client {

/// Reflectance of every surface of the study.
inline constexpr float kStudyAlbedo = 0.65f;

/// A scene of the experiment: every surface diffuse with kStudyAlbedo.
struct StudyScene {
  std::string name;               ///< "sibenik"; of a stand-in its own, "hall"
  std::string note;               ///< what it stands in for and why; empty where it is the real one
  Scene scene;                    ///< its camera is the first of `cameras`
  std::array<Camera, 2> cameras;  ///< from opposite sides
};

/// The scenes of Bulavintsev and Zhdanov 2020: "sibenik", "dragon", "conference".
std::vector<std::string> StudySceneNames();

/// Loads one of them from `folder`: sibenik/sibenik.obj.xz, with a point light;
/// dragon/dragon_vrip.ply.xz, on a ground under an area light; conference/conference_lbl.obj.xz
/// with its ceiling lights. Where the folder is empty or has no such file, the built-in scene that
/// is like it: hall, blob, room. INVALID_ARGUMENT: the file is broken, or there is no such scene.
absl::StatusOr<StudyScene> LoadStudyScene(const std::string& name, const std::string& folder);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_STUDY_STUDY_SCENE_H_
