#ifndef TREELIGHT_CLIENT_RENDER_IMAGE_FILE_H_
#define TREELIGHT_CLIENT_RENDER_IMAGE_FILE_H_

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/render/image.h"

namespace treelight::client {

/// The sRGB transfer function (IEC 61966-2-1): linear [0, 1] to the 8-bit code; clamps, NaN becomes
/// 0.
std::uint8_t EncodeSrgb(float linear);

/// Numbers of an EXR file.
enum class ExrPixels {
  kHalf,   ///< 16 bits, 11 of them significant
  kFloat,  ///< 32 bits
};

/// How a picture is stored.
struct ImageFileOptions {
  float exposure = 1;  ///< PNG: stops; linear values are multiplied with 2^exposure
  ExrPixels pixels = ExrPixels::kHalf;  ///< EXR
};

/// Whether EncodeImage knows the ending of `path`.
bool IsImagePath(const std::string& path);

/// The bytes of an 8-bit sRGB PNG or a linear EXR (ZIP), as the ending of `path` says; no file is
/// touched. INVALID_ARGUMENT: another ending. INTERNAL: the encoder failed; the message says why.
absl::StatusOr<std::string> EncodeImage(const Image& image, const std::string& path,
                                        const ImageFileOptions& options = {});

/// Writes what EncodeImage gives as an OutputFile, with the errors of both.
absl::Status WriteImage(const Image& image, const std::string& path,
                        const ImageFileOptions& options = {});

/// Reads channels R, G, B of an EXR. NOT_FOUND: there is no such file. INVALID_ARGUMENT: it is
/// damaged or has no such channels; the message names the file.
absl::StatusOr<Image> ReadExr(const std::string& path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_IMAGE_FILE_H_
