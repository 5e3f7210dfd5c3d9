#include <cmath>
#include <memory>
#include <string>

#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/render_report.h"
#include "client/output_file.h"
#include "client/render/difference.h"
#include "client/render/image_file.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  std::string picture_path, reference_path, difference_path;
  float scale = 0;  // 0: found
};

/// Reads an EXR all of whose numbers are finite.
absl::StatusOr<Image> ReadFinite(const std::string& path) {
  auto image = ReadExr(path);
  if (!image.ok()) return image;
  for (std::size_t i = 0; i < image->pixels.size(); ++i) {
    const Rgb& p = image->pixels[i];
    if (std::isfinite(p.r) && std::isfinite(p.g) && std::isfinite(p.b)) continue;
    const auto width = static_cast<std::size_t>(image->width);
    return absl::InvalidArgumentError(fmt::format("{}: pixel ({}, {}) is ({}, {}, {})", path,
                                                  i % width, i / width, p.r, p.g, p.b));
  }
  return image;
}

absl::Status WriteDifference(const Image& picture, const Image& reference, const Options& options,
                             OutputFile file) {
  const auto difference = ShowDifference(picture, reference, options.scale);
  if (!difference.ok()) return difference.status();
  const bool exr = IsExrPath(options.difference_path);
  const auto bytes =
      EncodeImage(exr ? difference->signed_difference : difference->colors, options.difference_path,
                  {.exposure = 0, .pixels = ExrPixels::kFloat});
  if (!bytes.ok()) return bytes.status();
  if (auto status = file.Write(*bytes); !status.ok()) return status;
  if (auto status = file.Commit(); !status.ok()) return status;
  if (exr) {
    fmt::print("difference: {}, {} minus {} in each channel\n", options.difference_path,
               options.picture_path, options.reference_path);
  } else {
    fmt::print(
        "difference: {}, white: none, red: {} is brighter, blue: darker; full colour at {:.4g}\n",
        options.difference_path, options.picture_path, difference->scale);
  }
  return absl::OkStatus();
}

absl::Status Run(const Options& options) {
  const auto picture = ReadFinite(options.picture_path);
  if (!picture.ok()) return picture.status();
  const auto reference = ReadFinite(options.reference_path);
  if (!reference.ok()) return reference.status();
  if (picture->width != reference->width || picture->height != reference->height) {
    return absl::InvalidArgumentError(
        fmt::format("{} is {} x {} pixels, {} is {} x {}", options.picture_path, picture->width,
                    picture->height, options.reference_path, reference->width, reference->height));
  }
  const auto error = Compare(*picture, *reference);
  if (!error.ok()) return error.status();
  if (options.difference_path.empty()) {
    fmt::print("{} {}", options.picture_path, FormatError(*error, options.reference_path));
    return absl::OkStatus();
  }
  auto file = OutputFile::Create(options.difference_path);
  if (!file.ok()) return file.status();
  fmt::print("{} {}", options.picture_path, FormatError(*error, options.reference_path));
  return WriteDifference(*picture, *reference, options, *std::move(file));
}

}  // namespace

void AddCompareCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("compare", "Tells how far one EXR is from another; needs no server");
  command->add_option("picture", options->picture_path, "EXR")->required()->type_name("A.exr");
  command->add_option("reference", options->reference_path, "EXR of the same size")
      ->required()
      ->type_name("B.exr");
  command
      ->add_option("--difference", options->difference_path,
                   "Where the difference goes: .exr, A - B in each channel; or .png, white where "
                   "they are the same, red where A is brighter, blue where it is darker")
      ->check([](const std::string& path) {
        return IsImagePath(path) ? "" : path + " ends neither in .png nor in .exr";
      });
  command
      ->add_option("--scale", options->scale,
                   "Difference that is full red or blue (default: one that 99 % of the pixels are "
                   "below)")
      ->check(NumberIn(1e-30, 1e30));
  command->footer(
      "RMSE: root of the mean squared difference over pixels and channels; also with values above "
      "1\n"
      "taken as 1. Relative MSE: mean of (A - B)^2 / (B^2 + 0.01). Mean: of A beside that of B.\n"
      "Exit code 0 however far they are apart; 1: a file cannot be read, or the sizes differ.");
  command->callback([options, &global] { global.action = [options] { return Run(*options); }; });
}

}  // namespace treelight::client
