#include "client/render/image_file.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <system_error>
#include <vector>

#include "OpenEXR/ImfArray.h"
#include "OpenEXR/ImfChannelList.h"
#include "OpenEXR/ImfFrameBuffer.h"
#include "OpenEXR/ImfHeader.h"
#include "OpenEXR/ImfIO.h"
#include "OpenEXR/ImfInputFile.h"
#include "OpenEXR/ImfOutputFile.h"
#include "client/output_file.h"
#include "client/regular_file.h"
#include "fmt/format.h"
#include "half.h"
#include "stb_image_write.h"

namespace treelight::client {
namespace {

/// Largest side of a picture that is read: a header is not to be trusted with memory.
constexpr int kMaxSide = 1 << 15;

std::string Ending(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  std::ranges::transform(ending, ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending;
}

/// Encoders write through it to a string, at any place of it.
class StringStream : public Imf::OStream {
 public:
  explicit StringStream(const std::string& name) : OStream(name.c_str()) {}

  void write(const char bytes[], int count) override {
    const auto size = static_cast<std::size_t>(count);
    bytes_.resize(std::max(bytes_.size(), place_ + size));
    std::copy_n(bytes, size, bytes_.begin() + static_cast<std::ptrdiff_t>(place_));
    place_ += size;
  }
  std::uint64_t tellp() override { return place_; }
  void seekp(std::uint64_t place) override { place_ = place; }

  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
  std::size_t place_ = 0;
};

absl::Status CannotEncode(const std::string& path, const std::string& reason) {
  return absl::InternalError(fmt::format("cannot encode {}: {}", path, reason));
}

absl::StatusOr<std::string> EncodePng(const Image& image, const std::string& path, float exposure) {
  const float scale = std::exp2(exposure);
  std::vector<std::uint8_t> bytes;
  bytes.reserve(3 * image.pixels.size());
  for (const Rgb& pixel : image.pixels) {
    for (const float channel : {pixel.r, pixel.g, pixel.b}) {
      bytes.push_back(EncodeSrgb(scale * channel));
    }
  }
  std::string file;
  const auto append = [](void* out, void* data, int size) {
    static_cast<std::string*>(out)->append(static_cast<const char*>(data),
                                           static_cast<std::size_t>(size));
  };
  if (stbi_write_png_to_func(append, &file, image.width, image.height, 3, bytes.data(),
                             3 * image.width) == 0) {
    return CannotEncode(path, "PNG encoder failed");
  }
  return file;
}

/// Adds three channels of rows of `Pixel`, which holds three numbers of type `type`, to `buffer`.
template <typename Pixel>
void AddSlices(const ExrChannels& channels, Imf::PixelType type, Pixel* pixels,
               const Imath::Box2i& window, Imf::FrameBuffer& buffer) {
  // Imf addresses pixel (x, y) as base + x * x_stride + y * y_stride, with x and y of the data
  // window.
  const std::size_t row = sizeof(Pixel) * static_cast<std::size_t>(window.max.x - window.min.x + 1);
  char* const base = reinterpret_cast<char*>(pixels) -
                     static_cast<std::ptrdiff_t>(sizeof(Pixel)) * window.min.x -
                     static_cast<std::ptrdiff_t>(row) * window.min.y;
  for (std::size_t c = 0; c < 3; ++c) {
    buffer.insert(channels[c], Imf::Slice(type, base + c * sizeof(Pixel) / 3, sizeof(Pixel), row));
  }
}

/// What is written under three names.
struct ExrLayer {
  ExrChannels channels;
  std::vector<Rgb> floats;
  std::vector<std::array<half, 3>> halves;
};

absl::StatusOr<std::string> EncodeExr(const Image& image, const std::string& path,
                                      const ImageFileOptions& options) {
  const bool halves = options.pixels == ExrPixels::kHalf;
  const Imf::PixelType type = halves ? Imf::HALF : Imf::FLOAT;
  std::vector<ExrLayer> layers{{kColorChannels, image.pixels, {}}};
  if (options.layers != nullptr) {
    layers.push_back({kAlbedoChannels, options.layers->albedo.pixels, {}});
    layers.push_back({kNormalChannels, options.layers->normals.pixels, {}});
  }
  try {
    Imf::Header header(image.width, image.height);
    header.compression() = Imf::ZIP_COMPRESSION;
    Imf::FrameBuffer buffer;
    for (ExrLayer& layer : layers) {
      if (layer.floats.size() != image.pixels.size())
        return CannotEncode(path, "a layer has another size than the picture");
      for (const char* name : layer.channels) header.channels().insert(name, Imf::Channel(type));
      if (halves) {
        for (const Rgb& p : layer.floats) layer.halves.push_back({half(p.r), half(p.g), half(p.b)});
        AddSlices(layer.channels, type, layer.halves.data(), header.dataWindow(), buffer);
      } else {
        AddSlices(layer.channels, type, layer.floats.data(), header.dataWindow(), buffer);
      }
    }
    StringStream stream(path);
    {
      Imf::OutputFile file(stream, header);
      file.setFrameBuffer(buffer);
      file.writePixels(image.height);
    }  // where the table of lines is written
    return stream.Take();
  } catch (const std::exception& error) {
    return CannotEncode(path, error.what());
  }
}

}  // namespace

std::uint8_t EncodeSrgb(float linear) {
  if (!(linear > 0)) return 0;
  const float x = std::min(linear, 1.0f);
  const float encoded = x <= 0.0031308f ? 12.92f * x : 1.055f * std::pow(x, 1 / 2.4f) - 0.055f;
  return static_cast<std::uint8_t>(std::lround(255 * encoded));
}

bool IsImagePath(const std::string& path) {
  const std::string ending = Ending(path);
  return ending == ".png" || ending == ".exr";
}

bool IsExrPath(const std::string& path) { return Ending(path) == ".exr"; }

absl::StatusOr<std::string> EncodeImage(const Image& image, const std::string& path,
                                        const ImageFileOptions& options) {
  const std::string ending = Ending(path);
  if (ending == ".png") return EncodePng(image, path, options.exposure);
  if (ending == ".exr") return EncodeExr(image, path, options);
  return absl::InvalidArgumentError(fmt::format("{} ends neither in .png nor in .exr", path));
}

absl::Status WriteImage(const Image& image, const std::string& path,
                        const ImageFileOptions& options) {
  const auto bytes = EncodeImage(image, path, options);
  if (!bytes.ok()) return bytes.status();
  auto file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  if (auto status = file->Write(*bytes); !status.ok()) return status;
  return file->Commit();
}

absl::StatusOr<Image> ReadExr(const std::string& path, const ExrChannels& channels) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) {
    return absl::NotFoundError(fmt::format("there is no file {}", path));
  }
  if (auto status = CheckRegularFile(path); !status.ok()) return status;
  try {
    Imf::InputFile file(path.c_str());
    const Imath::Box2i window = file.header().dataWindow();
    const auto width = std::int64_t{window.max.x} - window.min.x + 1;
    const auto height = std::int64_t{window.max.y} - window.min.y + 1;
    if (width > kMaxSide || height > kMaxSide) {
      return absl::InvalidArgumentError(
          fmt::format("{}: {} x {} pixels; at most {} a side", path, width, height, kMaxSide));
    }
    for (const char* name : channels) {
      if (file.header().channels().findChannel(name) == nullptr) {
        return absl::InvalidArgumentError(fmt::format("{}: there is no channel {}", path, name));
      }
    }
    Image image(static_cast<int>(width), static_cast<int>(height));
    Imf::FrameBuffer buffer;
    AddSlices(channels, Imf::FLOAT, image.pixels.data(), window, buffer);
    file.setFrameBuffer(buffer);
    file.readPixels(window.min.y, window.max.y);
    return image;
  } catch (const std::exception& damage) {
    return absl::InvalidArgumentError(
        fmt::format("{} is no EXR, or damaged: {}", path, damage.what()));
  }
}

}  // namespace treelight::client
