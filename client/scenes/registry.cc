#include "client/scenes/registry.h"

#include "client/scenes/blob.h"
#include "client/scenes/caustic.h"
#include "client/scenes/cornell.h"
#include "client/scenes/hall.h"
#include "client/scenes/room.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {
namespace {

struct Entry {
  std::string_view name;
  Scene (*make)();
};
constexpr Entry kScenes[] = {{"cornell", MakeCornell},
                             {"caustic", MakeCaustic},
                             {"hall", MakeHall},
                             {"room", MakeRoom},
                             {"blob", MakeBlob}};

}  // namespace

std::vector<std::string> BuiltInScenes() {
  std::vector<std::string> names;
  for (const Entry& entry : kScenes) names.emplace_back(entry.name);
  return names;
}

absl::StatusOr<Scene> MakeScene(std::string_view name) {
  for (const Entry& entry : kScenes) {
    if (entry.name == name) return entry.make();
  }
  return absl::NotFoundError(fmt::format("there is no scene \"{}\"; built in: {}", name,
                                         fmt::join(BuiltInScenes(), ", ")));
}

}  // namespace treelight::client
