#include "client/render/image.h"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "client/render/difference.h"
#include "client/render/image_file.h"
#include "gtest/gtest.h"
#include "stb_image.h"

namespace treelight::client {
namespace {

class ImageFileTest : public ::testing::Test {
 protected:
  ImageFileTest() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::temp_directory_path() /
              ("treelight_image_" + std::to_string(getpid()) + "_" + test->name());
    std::filesystem::create_directory(folder_);
  }
  ~ImageFileTest() override { std::filesystem::remove_all(folder_); }

  std::string Path(const std::string& name) const { return folder_ / name; }

  std::filesystem::path folder_;
};

/// Every pixel another colour, some of them no display can show.
Image MakeImage() {
  Image image(13, 7);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    const auto x = static_cast<float>(i);
    image.pixels[i] = {x / 91, 0.001f * x, 17.3f * std::sin(x)};
  }
  return image;
}

TEST_F(ImageFileTest, FloatExrIsTheSameBits) {
  const Image image = MakeImage();
  ASSERT_TRUE(WriteImage(image, Path("a.exr"), {.pixels = ExrPixels::kFloat}).ok());
  const auto read = ReadExr(Path("a.exr"));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->width, 13);
  EXPECT_EQ(read->height, 7);
  EXPECT_EQ(read->pixels, image.pixels);
}

TEST_F(ImageFileTest, HalfExrKeepsElevenBits) {
  const Image image = MakeImage();
  ASSERT_TRUE(WriteImage(image, Path("a.EXR")).ok());
  const auto read = ReadExr(Path("a.EXR"));
  ASSERT_TRUE(read.ok()) << read.status();
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    EXPECT_NEAR(read->pixels[i].r, image.pixels[i].r, std::abs(image.pixels[i].r) / 2048) << i;
    EXPECT_NEAR(read->pixels[i].g, image.pixels[i].g, std::abs(image.pixels[i].g) / 2048) << i;
    EXPECT_NEAR(read->pixels[i].b, image.pixels[i].b, std::abs(image.pixels[i].b) / 2048) << i;
  }
}

TEST_F(ImageFileTest, ExrHoldsLayers) {
  const Image image = MakeImage();
  FeatureLayers layers{.albedo = Image(13, 7), .normals = Image(13, 7)};
  for (int i = 0; i < 91; ++i) {
    layers.albedo.pixels[i] = {0.01f * i, 0.5f, 1 - 0.01f * i};
    layers.normals.pixels[i] = {-1 + 0.01f * i, 0.25f, -0.125f};
  }
  ImageFileOptions options{.pixels = ExrPixels::kFloat, .layers = &layers};
  ASSERT_TRUE(WriteImage(image, Path("a.exr"), options).ok());
  EXPECT_EQ(ReadExr(Path("a.exr"))->pixels, image.pixels);
  EXPECT_EQ(ReadExr(Path("a.exr"), kAlbedoChannels)->pixels, layers.albedo.pixels);
  EXPECT_EQ(ReadExr(Path("a.exr"), kNormalChannels)->pixels, layers.normals.pixels);
  options.pixels = ExrPixels::kHalf;
  ASSERT_TRUE(WriteImage(image, Path("half.exr"), options).ok());
  const auto half = ReadExr(Path("half.exr"), kNormalChannels);
  ASSERT_TRUE(half.ok()) << half.status();
  for (int i = 0; i < 91; ++i)
    EXPECT_NEAR(half->pixels[i].r, layers.normals.pixels[i].r, 1.0 / 2048) << i;

  // Without them a reader is told; of another size they are refused.
  ASSERT_TRUE(WriteImage(image, Path("plain.exr")).ok());
  const auto none = ReadExr(Path("plain.exr"), kAlbedoChannels);
  EXPECT_EQ(none.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(none.status().message().find("albedo.R"), std::string::npos) << none.status();
  layers.albedo = Image(13, 6);
  EXPECT_FALSE(WriteImage(image, Path("b.exr"), options).ok());
}

TEST_F(ImageFileTest, PngHoldsTheSrgbCodes) {
  const Image image = MakeImage();
  ASSERT_TRUE(WriteImage(image, Path("a.png"), {.exposure = 2}).ok());
  int width = 0, height = 0, channels = 0;
  stbi_uc* const bytes = stbi_load(Path("a.png").c_str(), &width, &height, &channels, 0);
  ASSERT_NE(bytes, nullptr);
  EXPECT_EQ(width, 13);
  EXPECT_EQ(height, 7);
  ASSERT_EQ(channels, 3);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    EXPECT_EQ(bytes[3 * i], EncodeSrgb(4 * image.pixels[i].r)) << i;
    EXPECT_EQ(bytes[3 * i + 1], EncodeSrgb(4 * image.pixels[i].g)) << i;
    EXPECT_EQ(bytes[3 * i + 2], EncodeSrgb(4 * image.pixels[i].b)) << i;
  }
  stbi_image_free(bytes);
}

TEST(Srgb, FollowsTheStandard) {
  EXPECT_EQ(EncodeSrgb(0), 0);
  EXPECT_EQ(EncodeSrgb(1), 255);
  EXPECT_EQ(EncodeSrgb(0.5f), 188);
  EXPECT_EQ(EncodeSrgb(0.2122308f), 127);  // what code 127 stands for
  EXPECT_EQ(EncodeSrgb(0.002f), 7);        // linear part: 255 * 12.92 * 0.002 = 6.59
  EXPECT_EQ(EncodeSrgb(7), 255);
  EXPECT_EQ(EncodeSrgb(-1), 0);
  EXPECT_EQ(EncodeSrgb(NAN), 0);
}

TEST_F(ImageFileTest, FailuresNameTheFile) {
  const Image image = MakeImage();
  EXPECT_EQ(WriteImage(image, Path("a.jpg")).code(), absl::StatusCode::kInvalidArgument);
  for (const char* name : {"no/a.png", "no/a.exr"}) {
    const auto status = WriteImage(image, Path(name));
    EXPECT_FALSE(status.ok());
    EXPECT_NE(status.message().find(name), std::string::npos) << status;
  }
  EXPECT_EQ(ReadExr(Path("none.exr")).status().code(), absl::StatusCode::kNotFound);

  // Every prefix of a good file is refused.
  ASSERT_TRUE(WriteImage(image, Path("good.exr")).ok());
  std::ifstream good(Path("good.exr"), std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(good)), {});
  for (std::size_t size = 0; size < bytes.size(); size += 37) {
    std::ofstream(Path("bad.exr"), std::ios::binary) << bytes.substr(0, size);
    const auto read = ReadExr(Path("bad.exr"));
    ASSERT_EQ(read.status().code(), absl::StatusCode::kInvalidArgument) << size;
    EXPECT_NE(read.status().message().find("bad.exr"), std::string::npos);
  }
}

TEST(Compare, MeasuresDifferences) {
  Image a(2, 1), b(2, 1);
  a.pixels = {{1, 1, 1}, {2, 2, 2}};
  b.pixels = {{1, 1, 1}, {1, 1, 1}};
  const auto error = Compare(a, b);
  ASSERT_TRUE(error.ok());
  EXPECT_DOUBLE_EQ(error->rmse, std::sqrt(0.5));
  EXPECT_DOUBLE_EQ(error->clipped_rmse, 0);
  EXPECT_DOUBLE_EQ(error->relative_mse, 0.5 / 1.01);
  EXPECT_DOUBLE_EQ(error->mean_ratio, 1.5);
  const auto swapped = Compare(b, a);
  ASSERT_TRUE(swapped.ok());
  EXPECT_DOUBLE_EQ(swapped->clipped_rmse, 0);
  a.pixels[1] = {0.5f, 0.5f, 0.5f};
  EXPECT_DOUBLE_EQ(Compare(a, b)->clipped_rmse, std::sqrt(0.125));
  EXPECT_EQ(Compare(a, Image(1, 2)).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(ShowDifference, IsRedWhereBrighterAndBlueWhereDarker) {
  Image a(3, 1), b(3, 1);
  a.pixels = {{1, 1, 1}, {2, 2, 2}, {0, 0, 0}};
  b.pixels = {{1, 1, 1}, {1, 1, 1}, {0.5f, 0.5f, 0.5f}};
  const auto difference = ShowDifference(a, b, 2);
  ASSERT_TRUE(difference.ok()) << difference.status();
  EXPECT_EQ(difference->scale, 2);
  EXPECT_EQ(difference->signed_difference.pixels,
            (std::vector<Rgb>{{}, {1, 1, 1}, {-0.5f, -0.5f, -0.5f}}));
  EXPECT_EQ(difference->colors.pixels,
            (std::vector<Rgb>{{1, 1, 1}, {1, 0.5f, 0.5f}, {0.75f, 0.75f, 1}}));
  const auto saturated = ShowDifference(a, b, 0.25f);
  EXPECT_EQ(saturated->colors.pixels, (std::vector<Rgb>{{1, 1, 1}, {1, 0, 0}, {0, 0, 1}}));
  EXPECT_FALSE(ShowDifference(a, Image(1, 3)).ok());
}

TEST(ShowDifference, ScalesToWhatNearlyAllPixelsAreBelow) {
  Image a(1000, 1), b(1000, 1);
  for (int i = 0; i < 1000; ++i) a.pixels[i].g = -0.003f * static_cast<float>(i);  // mean -0.001 i
  EXPECT_NEAR(ShowDifference(a, b)->scale, 0.989, 1e-4);
  EXPECT_EQ(ShowDifference(b, b)->scale, 1);
  a = b;
  a.pixels[7] = {6, 0, 0};  // fewer than 1 of 100 differ
  EXPECT_EQ(ShowDifference(a, b)->scale, 2);
}

}  // namespace
}  // namespace treelight::client
