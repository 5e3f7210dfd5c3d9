#include "client/trace/random.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <set>

#include "client/scenes/vector.h"
#include "client/trace/sampling.h"
#include "gtest/gtest.h"

namespace treelight::client {
namespace {

// Known answers of the authors' library (Random123, kat_vectors, philox4x32 with 10 rounds).
TEST(Philox, GivesTheKnownAnswers) {
  using Block = std::array<std::uint32_t, 4>;
  EXPECT_EQ(Philox({0, 0, 0, 0}, {0, 0}), (Block{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  const std::uint32_t ones = 0xffffffff;
  EXPECT_EQ(Philox({ones, ones, ones, ones}, {ones, ones}),
            (Block{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(Philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Block{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(RandomStream, DependsOnSeedPurposeAndIndex) {
  std::set<float> first;
  for (const std::uint64_t seed : {1ull, 2ull, 1ull << 40}) {
    for (const auto purpose : {RandomPurpose::kPhotonPath, RandomPurpose::kCameraSample}) {
      for (const std::uint64_t index : {0ull, 1ull, 1ull << 40}) {
        first.insert(RandomStream(seed, purpose, index).Uniform());
      }
    }
  }
  EXPECT_EQ(first.size(), 18u);
  RandomStream a(7, RandomPurpose::kPhotonPath, 3), b(7, RandomPurpose::kPhotonPath, 3);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(a.Uniform(), b.Uniform());
}

TEST(RandomStream, IsUniform) {
  RandomStream random(1, RandomPurpose::kPhotonPath, 0);
  constexpr int kCount = 100'000;
  std::array<int, 10> bins{};
  double sum = 0;
  for (int i = 0; i < kCount; ++i) {
    const float u = random.Uniform();
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    ++bins[static_cast<int>(10 * u)];
    sum += u;
  }
  EXPECT_NEAR(sum / kCount, 0.5, 0.005);
  for (const int count : bins) EXPECT_NEAR(count, kCount / 10, 500);
}

TEST(RandomStream, FineNumbersAreUniformToTheLastBits) {
  RandomStream random(4, RandomPurpose::kPhotonPath, 0);
  constexpr int kCount = 100'000;
  std::array<int, 16> leading{}, trailing{};
  for (int i = 0; i < kCount; ++i) {
    const double u = random.FineUniform();
    ASSERT_GE(u, 0);
    ASSERT_LT(u, 1);
    const auto bits = static_cast<std::uint64_t>(u * 0x1p53);
    EXPECT_EQ(static_cast<double>(bits) * 0x1p-53, u);
    ++leading[bits >> 49], ++trailing[bits & 15];
  }
  for (int i = 0; i < 16; ++i) {
    EXPECT_NEAR(leading[i], kCount / 16, 400);
    EXPECT_NEAR(trailing[i], kCount / 16, 400);
  }
}

// About a normal n the density cos / pi has the mean (2/3) n, and cos^2 the mean 1/2.
TEST(CosineDirection, HasTheMomentsOfItsDensity) {
  RandomStream random(2, RandomPurpose::kPhotonPath, 0);
  for (const Vec3& normal :
       {Vec3{0, 0, 1}, Vec3{0, 0, -1}, Vec3{0, 1, 0}, Normalize(Vec3{-1, 2, -3})}) {
    constexpr int kCount = 200'000;
    double mean[3] = {}, squared_cosine = 0;
    for (int i = 0; i < kCount; ++i) {
      const float u = random.Uniform(), v = random.Uniform();
      const Vec3 d = CosineDirection(normal, u, v);
      ASSERT_NEAR(Length(d), 1, 1e-5);
      ASSERT_GE(Dot(d, normal), -1e-6f);
      mean[0] += d.x / double{kCount}, mean[1] += d.y / double{kCount},
          mean[2] += d.z / double{kCount};
      squared_cosine += Dot(d, normal) * Dot(d, normal) / double{kCount};
    }
    EXPECT_NEAR(mean[0], 2.0 / 3 * normal.x, 0.005);
    EXPECT_NEAR(mean[1], 2.0 / 3 * normal.y, 0.005);
    EXPECT_NEAR(mean[2], 2.0 / 3 * normal.z, 0.005);
    EXPECT_NEAR(squared_cosine, 0.5, 0.005);
  }
}

// Density (n + 1) / (2 pi) cos^n: the mean cosine is (n + 1) / (n + 2).
TEST(PhongDirection, HasTheMeanOfItsDensity) {
  RandomStream random(5, RandomPurpose::kPhotonPath, 0);
  const Vec3 axis = Normalize(Vec3{1, -2, 2});
  for (const float n : {0.0f, 1.0f, 30.0f}) {
    double mean = 0;
    constexpr int kCount = 100'000;
    for (int i = 0; i < kCount; ++i) {
      const float u = random.Uniform(), v = random.Uniform();
      mean += Dot(PhongDirection(axis, n, u, v), axis) / double{kCount};
    }
    EXPECT_NEAR(mean, (n + 1) / (n + 2), 0.004) << n;
  }
}

// However narrow the cone, directions stay in it and are uniform by solid angle: 1 - cos is.
TEST(ConeDirection, IsUniformInTheCone) {
  RandomStream random(6, RandomPurpose::kPhotonPath, 0);
  const Vec3 axis = Normalize(Vec3{-1, 2, 3});
  for (const float height : {2.0f, 0.5f, 1e-3f, 1e-9f}) {
    double mean = 0;
    constexpr int kCount = 50'000;
    for (int i = 0; i < kCount; ++i) {
      const float u = random.Uniform(), v = random.Uniform();
      const Vec3 direction = ConeDirection(axis, height, u, v);
      const Vec3 across = Cross(axis, direction);
      const double sine = std::min(1.0f, Length(across));
      const double drop = Dot(axis, direction) > 0 ? sine * sine / (1 + std::sqrt(1 - sine * sine))
                                                   : 1 + std::sqrt(1 - sine * sine);
      ASSERT_LE(drop, 1.02 * height);
      mean += drop / height / kCount;
    }
    EXPECT_NEAR(mean, 0.5, 0.01) << height;
  }
}

TEST(TrianglePoint, IsUniformByArea) {
  const Vec3 a{0, 0, 0}, b{1, 0, 0}, c{0, 1, 0};
  RandomStream random(3, RandomPurpose::kPhotonPath, 0);
  constexpr int kCount = 100'000;
  int below = 0;  // x + y < 1/2: a quarter of the area
  for (int i = 0; i < kCount; ++i) {
    const float u = random.Uniform(), v = random.Uniform();
    const Vec3 p = TrianglePoint(a, b, c, u, v);
    ASSERT_GE(p.x, 0);
    ASSERT_GE(p.y, 0);
    ASSERT_LE(p.x + p.y, 1.000001f);
    below += p.x + p.y < 0.5f;
  }
  EXPECT_NEAR(below, kCount / 4, 700);
}

}  // namespace
}  // namespace treelight::client
