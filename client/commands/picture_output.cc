#include "client/commands/picture_output.h"

#include "client/commands/output.h"
#include "fmt/format.h"

namespace treelight::client {

absl::StatusOr<PictureOutput> PictureOutput::Open(const std::vector<std::string>& paths,
                                                  const std::string& preview_path) {
  PictureOutput output;
  for (const std::string& path : paths) {
    auto file = OutputFile::Create(path);
    if (!file.ok()) return file.status();
    output.pictures_.push_back({path, *std::move(file)});
  }
  output.preview_path_ = preview_path;
  if (!preview_path.empty()) {
    if (const auto file = OutputFile::Create(preview_path); !file.ok()) return file.status();
  }
  return output;
}

void PictureOutput::Preview(const Image& image, const ImageFileOptions& options) {
  if (preview_path_.empty()) return;
  const auto status = WriteImage(image, preview_path_, options);
  if (status.ok() || warned_) return;
  warned_ = true;
  Warn(fmt::format("no preview: {}", std::string(status.message())));
}

absl::Status PictureOutput::Write(const Image& image, const ImageFileOptions& options) {
  for (Picture& picture : pictures_) {
    const auto bytes = EncodeImage(image, picture.path, options);
    if (!bytes.ok()) return bytes.status();
    if (auto status = picture.file.Write(*bytes); !status.ok()) return status;
    if (auto status = picture.file.Commit(); !status.ok()) return status;
    fmt::print("picture: {}\n", picture.path);
  }
  Preview(image, options);
  return absl::OkStatus();
}

}  // namespace treelight::client
