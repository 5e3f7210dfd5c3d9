#include "core/build_chooser.h"

#include <future>
#include <map>
#include <random>
#include <utility>

#include "core/cost_meter.h"
#include "core/cpu/bounds.h"
#include "core/model/morton.h"
#include "gtest/gtest.h"
#include "tests/clouds.h"
#include "tests/counting_builder.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

constexpr std::size_t kHybrid = 3;

/// Costs by which lbvh with leaves of 64 is the fastest to build and hybrid the fastest to search.
BuildCosts MadeUpCosts() {
  BuildCosts costs;
  costs.trees = {{{.build_us = 100, .photon_us = 0.05, .gather_us = 1.2},
                  {.build_us = 100, .photon_us = 0.04, .gather_us = 1.2},
                  {.build_us = 100, .photon_us = 0.03, .gather_us = 1.2},
                  {.build_us = 200, .photon_us = 0.2, .gather_us = 1}}};
  costs.long_code_us = 0.01;
  costs.shared_cell_us = 0.02;
  return costs;
}

TEST(ChooseBuildTest, BuildAndGathersTogetherAreLeast) {
  constexpr std::uint64_t kPhotons = 1'000'000;
  // hybrid: 170 100 us more to build, 0.2 us less for a gather.
  const double even = 170'100 / 0.2;
  const auto chosen = [&](double gathers) {
    return ChooseBuild(MadeUpCosts(), {}, kPhotons,
                       {.expected_gathers = static_cast<std::uint64_t>(gathers)}, {});
  };
  const BuildChoice few = chosen(even - 10), many = chosen(even + 10);
  EXPECT_EQ(few.options.builder, BuilderKind::kLbvh);
  EXPECT_EQ(few.options.max_leaf_size, 64u);
  EXPECT_EQ(many.options.builder, BuilderKind::kHybrid);
  EXPECT_EQ(many.options.max_leaf_size, 32u);
  EXPECT_EQ(many.options.subtree_size, kCandidateSubtree);
  EXPECT_EQ(many.options.morton_bits, MortonBits::k30);
  EXPECT_NE(few.reason.find("lbvh with leaves of 64 takes 30.1 ms to build"), std::string::npos)
      << few.reason;
  EXPECT_NE(few.reason.find("hybrid with leaves of 32 takes 200 ms"), std::string::npos);
}

TEST(ChooseBuildTest, WithoutANumberAsManyGathersAsPhotons) {
  // 0.17 us more to build for each photon, 0.2 us less for each gather: from 3 334 photons on.
  EXPECT_EQ(ChooseBuild(MadeUpCosts(), {}, 3000, {}, {}).options.builder, BuilderKind::kLbvh);
  EXPECT_EQ(ChooseBuild(MadeUpCosts(), {}, 4000, {}, {}).options.builder, BuilderKind::kHybrid);
}

TEST(ChooseBuildTest, WhatIsSaidStays) {
  const AutoBuild asked{.expected_gathers = 1, .max_leaf_size = 20, .morton_bits = MortonBits::k63};
  const BuildOptions rest{.heuristic = Heuristic::kVvh, .radius = 2, .seed = 9};
  const BuildOptions options = ChooseBuild(MadeUpCosts(), {}, 1000, asked, rest).options;
  EXPECT_EQ(options.builder, BuilderKind::kLbvh);
  EXPECT_EQ(options.max_leaf_size, 20u);
  EXPECT_EQ(options.morton_bits, MortonBits::k63);
  EXPECT_EQ(options.heuristic, Heuristic::kVvh);
  EXPECT_EQ(options.radius, 2);
  EXPECT_EQ(options.seed, 9u);
}

TEST(ChooseBuildTest, LongCodesWhereTheySaveMoreThanTheyCost) {
  const auto bits = [](const SharedCells& shared) {
    return ChooseBuild(MadeUpCosts(), shared, 1000, {}, {}).options.morton_bits;
  };
  EXPECT_EQ(bits({.of_30_bits = 0.49, .of_63_bits = 0}), MortonBits::k30);
  EXPECT_EQ(bits({.of_30_bits = 0.51, .of_63_bits = 0}), MortonBits::k63);
  EXPECT_EQ(bits({.of_30_bits = 1, .of_63_bits = 0.51}), MortonBits::k30);
  EXPECT_EQ(bits({.of_30_bits = 1, .of_63_bits = 1}), MortonBits::k30);
}

/// Parts that share a cell, by counting all cells of a grid.
double PlainPart(const std::vector<float>& positions, unsigned bits, std::size_t many) {
  const MortonGrid grid = MakeMortonGrid(BoundsOf(positions), bits);
  std::map<std::uint64_t, std::size_t> cells;
  for (std::size_t i = 0; i < positions.size(); i += 3) {
    ++cells[MortonCode({positions[i], positions[i + 1], positions[i + 2]}, grid, bits)];
  }
  std::size_t sharing = 0;
  for (const auto& [code, count] : cells) sharing += count >= many ? count : 0;
  return static_cast<double>(sharing) / static_cast<double>(positions.size() / 3);
}

TEST(CountSharedCellsTest, FewPhotonsAreAllCounted) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::uint32_t leaf_size : {1u, 16u}) {
      const auto positions = shape.make(3000, 5);
      const SharedCells shared = CountSharedCells(positions, leaf_size);
      EXPECT_EQ(shared.of_30_bits, PlainPart(positions, 10, 4 * leaf_size)) << shape.name;
      EXPECT_EQ(shared.of_63_bits, PlainPart(positions, 21, 4 * leaf_size)) << shape.name;
    }
  }
}

TEST(CountSharedCellsTest, ASampleIsNearAllOfThem) {
  const std::uint32_t seed = std::random_device{}();
  SCOPED_TRACE(testing::Message() << "seed " << seed);
  std::mt19937 engine(seed);
  std::uniform_real_distribution<float> uniform;
  std::vector<float> positions(3 * 200'000);
  for (std::size_t i = 0; i < positions.size() / 3; ++i) {
    // Three of ten in one cell of 30 bits, spread over many of 63.
    const float scale = i % 10 < 3 ? 1e-4f : 1;
    for (int axis = 0; axis < 3; ++axis) positions[3 * i + axis] = scale * uniform(engine);
  }
  const SharedCells shared = CountSharedCells(positions, 16);
  EXPECT_NEAR(shared.of_30_bits, 0.3, 0.02);  // five standard deviations of 16 384 draws
  EXPECT_EQ(shared.of_63_bits, 0);
}

TEST(CountSharedCellsTest, NoPhotonsShareNothing) {
  EXPECT_EQ(CountSharedCells({}, 16).of_30_bits, 0);
  EXPECT_EQ(CountSharedCells({1, 2, 3}, 1).of_63_bits, 0);
}

TEST(MeasureBuildCostsTest, EveryCandidateCostsSomethingOnEachDevice) {
  const auto cpu = MakeCpuBuilder();
  for (Builder* const builder : {cpu.get(), &TestBuilder()}) {
    for (const std::uint32_t k : {0u, 64u}) {
      const auto costs = MeasureBuildCosts(*builder, k);
      ASSERT_TRUE(costs.ok()) << costs.status();
      const auto build_us = [&](std::size_t i) {  // of as many photons as were measured
        return costs->trees[i].build_us + 131'072 * costs->trees[i].photon_us;
      };
      for (std::size_t i = 0; i < kTreeCandidates.size(); ++i) {
        EXPECT_GT(build_us(i), 0);
        EXPECT_LT(build_us(i), 1e8);
        EXPECT_GT(costs->trees[i].gather_us, 0);
        EXPECT_LT(costs->trees[i].gather_us, 1000);
      }
      // A sweep of every subtree cannot be as fast as the order of codes that it starts from.
      EXPECT_GT(build_us(kHybrid), build_us(2));
    }
  }
}

TEST(BuildChooserTest, MeasuresOnceForAnOrderOfMagnitudeOfK) {
  CountingBuilder builder;
  BuildChooser chooser(builder);
  const Photons photons = MakeCloud(CloudNamed("uniform"), 1000, 1);
  const auto builds_for = [&](const AutoBuild& asked) {
    const int before = builder.builds;
    const auto choice = chooser.Choose(photons, asked, {});
    EXPECT_TRUE(choice.ok()) << choice.status();
    EXPECT_EQ(chooser.WorkBytes(asked), 0u);
    return builder.builds - before;
  };
  EXPECT_EQ(chooser.WorkBytes({}), kMeasureBytes);
  EXPECT_GT(builds_for({.expected_k = 50}), 0);
  EXPECT_EQ(builds_for({.expected_k = 50}), 0);
  EXPECT_EQ(builds_for({.expected_gathers = 7, .expected_k = 33, .max_leaf_size = 5}), 0);
  EXPECT_EQ(builds_for({.expected_k = 64}), 0);
  EXPECT_EQ(chooser.WorkBytes({.expected_k = 65}), kMeasureBytes);
  EXPECT_GT(builds_for({.expected_k = 65}), 0);
  EXPECT_GT(builds_for({.expected_k = 0}), 0);
  EXPECT_GT(builds_for({.expected_k = 1}), 0);
  EXPECT_EQ(builds_for({.expected_k = 8}), 0);
  EXPECT_EQ(chooser.Choose({}, {}, {}).status(), absl::OkStatus());
}

TEST(BuildChooserTest, CancelledMeasurementsAreMadeAgain) {
  CountingBuilder builder;
  BuildChooser chooser(builder);
  const Photons photons = MakeCloud(CloudNamed("uniform"), 1000, 1);
  EXPECT_EQ(chooser.Choose(photons, {}, {}, [] { return true; }).status().code(),
            absl::StatusCode::kCancelled);
  EXPECT_TRUE(chooser.Choose(photons, {}, {}).ok());
}

/// Has another thread ask for `chooser`'s WorkBytes during each build.
class AskingBuilder : public Builder {
 public:
  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck& cancelled) override {
    std::async(std::launch::async, [this] { return chooser->WorkBytes({}); }).get();
    return cpu_->Build(photons, options, cancelled);
  }
  const BuildChooser* chooser = nullptr;

 private:
  const std::unique_ptr<Builder> cpu_ = MakeCpuBuilder();
};

TEST(BuildChooserTest, NobodyWaitsForAMeasurement) {
  AskingBuilder builder;
  BuildChooser chooser(builder);
  builder.chooser = &chooser;
  // Would not end where the measurement kept others from WorkBytes.
  EXPECT_TRUE(chooser.Choose(MakeCloud(CloudNamed("uniform"), 1000, 1), {}, {}).ok());
}

TEST(BuildChooserTest, WhatItChoosesCanBeBuilt) {
  const auto cpu = MakeCpuBuilder();
  for (Builder* const builder : {cpu.get(), &TestBuilder()}) {
    BuildChooser chooser(*builder);
    for (const CloudShape& shape : AllClouds()) {
      const Photons photons = MakeCloud(shape, 500, 3);
      for (const std::uint64_t gathers : {1ull, 1'000'000'000ull}) {
        for (const std::uint32_t leaf_size : {0u, 1u, 64u}) {
          const AutoBuild asked{.expected_gathers = gathers, .max_leaf_size = leaf_size};
          const auto choice = chooser.Choose(photons, asked, {});
          ASSERT_TRUE(choice.ok()) << choice.status();
          const auto map = builder->Build(photons, choice->options);
          ASSERT_TRUE(map.ok()) << shape.name << ": " << map.status();
          const BuildOptions largest = LargestBuild(asked, {});
          EXPECT_LE(builder->WorkBytes(choice->options, 500), builder->WorkBytes(largest, 500));
        }
      }
    }
  }
}

}  // namespace
}  // namespace treelight
