#ifndef TREELIGHT_TESTS_SHARED_SCENES_H_
#define TREELIGHT_TESTS_SHARED_SCENES_H_

#include <cstdlib>
#include <filesystem>
#include <string>

namespace treelight::testing {

/// The folder of the sample scenes, which are not part of the repository: $TREELIGHT_SCENES, else
/// shared/scenes beside the source folder. Empty where there is none: a test that needs them skips.
inline std::string SharedScenesFolder() {
  const char* const set = std::getenv("TREELIGHT_SCENES");
  const std::string folder =
      set != nullptr && *set != 0 ? set : TREELIGHT_SOURCE_FOLDER "/../shared/scenes";
  return std::filesystem::is_directory(folder) ? folder : "";
}

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_SHARED_SCENES_H_
