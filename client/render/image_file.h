#ifndef TREELIGHT_CLIENT_RENDER_IMAGE_FILE_H_
#define TREELIGHT_CLIENT_RENDER_IMAGE_FILE_H_

#include <array>
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
  /// EXR: null, or layers of the size of the picture, stored as channels albedo.R, albedo.G,
  /// albedo.B, normal.X, normal.Y, normal.Z.
  const FeatureLayers* layers = nullptr;
};

/// Names of three channels of an EXR.
using ExrChannels = std::array<const char*, 3>;
inline constexpr ExrChannels kColorChannels = {"R", "G", "B"};
inline constexpr ExrChannels kAlbedoChannels = {"albedo.R", "albedo.G", "albedo.B"};
inline constexpr ExrChannels kNormalChannels = {"normal.X", "normal.Y", "normal.Z"};

/// Whether EncodeImage knows the ending of `path`.
bool IsImagePath(const std::string& path);

/// Whether EncodeImage makes an EXR for `path`.
bool IsExrPath(const std::string& path);

/// The bytes of an 8-bit sRGB PNG or a linear EXR (ZIP), as the ending of `path` says; no file is
/// touched. INVALID_ARGUMENT: another ending. INTERNAL: the encoder failed; the message says why.
absl::StatusOr<std::string> EncodeImage(const Image& image, const std::string& path,
                                        const ImageFileOptions& options = {});

/// Writes what EncodeImage gives as an OutputFile, with the errors of both.
absl::Status WriteImage(const Image& image, const std::string& path,
                        const ImageFileOptions& options = {});

/// Reads three channels of an EXR. NOT_FOUND: there is no such file. INVALID_ARGUMENT: it is
/// damaged, no EXR, or has no such channels; the message names the file.
absl::StatusOr<Image> ReadExr(const std::string& path,
                              const ExrChannels& channels = kColorChannels);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_IMAGE_FILE_H_
