#ifndef TREELIGHT_CLIENT_COMMANDS_RENDER_PROGRESSIVE_H_
#define TREELIGHT_CLIENT_COMMANDS_RENDER_PROGRESSIVE_H_

#include <functional>
#include <optional>

#include "client/commands/command.h"
#include "client/commands/render_options.h"
#include "client/render/image.h"
#include "client/trace/intersector.h"

namespace treelight::client {

/// What becomes of a picture while it is rendered and at its end.
struct Viewer {
  PreviewOptions preview;
  std::function<absl::Status(const Image&)> finish;
  const Image* reference = nullptr;  ///< that the picture is compared with; null: none
};

/// `render --progressive`: passes until the error, the time, the passes or the user end them; the
/// picture of the passes that are done goes to `viewer`. The errors of RenderProgressively, with
/// the passes that were done.
absl::Status RenderInPasses(const Intersector& scene, const RenderChoice& choice,
                            const GlobalOptions& global, const Viewer& viewer);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_RENDER_PROGRESSIVE_H_
