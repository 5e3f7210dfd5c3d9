#include "client/render/image.h"

#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

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

}  // namespace
}  // namespace treelight::client
