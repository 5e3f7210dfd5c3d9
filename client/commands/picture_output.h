#ifndef TREELIGHT_CLIENT_COMMANDS_PICTURE_OUTPUT_H_
#define TREELIGHT_CLIENT_COMMANDS_PICTURE_OUTPUT_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/output_file.h"
#include "client/render/image_file.h"

namespace treelight::client {

/// The files of a picture, opened before any work: what cannot be written is told at once.
class PictureOutput {
 public:
  /// The errors of OutputFile::Create. `preview_path` may be empty; it is tried, and not created.
  static absl::StatusOr<PictureOutput> Open(const std::vector<std::string>& paths,
                                            const std::string& preview_path);

  /// Rewrites the preview, if there is one: under its name there is always a whole picture. Where
  /// that fails, warns once, since the picture itself goes on.
  void Preview(const Image& image, const ImageFileOptions& options);

  /// Writes all files, the preview last, and says so on stdout. Once. The errors of EncodeImage and
  /// OutputFile.
  absl::Status Write(const Image& image, const ImageFileOptions& options);

 private:
  struct Picture {
    std::string path;
    OutputFile file;
  };

  PictureOutput() = default;

  std::vector<Picture> pictures_;
  std::string preview_path_;
  bool warned_ = false;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_PICTURE_OUTPUT_H_
