// Gathers from merged photons: what is merged, what an answer is made of, and that a batch keeps
// the error that it asks for, on sets that nothing was tuned for.

#include <cmath>
#include <memory>
#include <numeric>
#include <random>
#include <string>
#include <vector>

#include "core/builder.h"
#include "core/gatherer.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/answers.h"
#include "tests/clouds.h"
#include "tests/merged_maps.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

constexpr std::uint32_t kSums = kOutputCount | kOutputRadius | kOutputDensity;

Builder& CpuBuilder() {
  static const std::unique_ptr<Builder> builder = MakeCpuBuilder();
  return *builder;
}

std::vector<double> TotalPower(const Photons& photons) {
  std::vector<double> total(3);
  for (std::size_t i = 0; i < photons.powers.size(); ++i) total[i % 3] += photons.powers[i];
  return total;
}

TEST(MergePhotonsTest, AWorkedExample) {
  // Two far pairs: the left one weighs 1 to 3, so that its centroid is 3/4 of the way.
  Photons photons;
  photons.positions = {0, 0, 0, 4, 0, 0, 100, 0, 0, 100, 8, 0};
  photons.powers = {1, 0, 0, 0, -3, 0, 2, 2, 2, 2, 2, 2};
  photons.directions = {1, 2, 3, 4, 5, 6, 7, 8};
  const auto tree = *(*CpuBuilder().Build(photons, {.max_leaf_size = 4}))->ReadTree();
  const Photons merged = MergePhotons(tree, photons, 2);
  ASSERT_EQ(merged.size(), 2u);
  EXPECT_EQ(merged.positions, (std::vector<float>{3, 0, 0, 100, 4, 0}));
  EXPECT_EQ(merged.powers, (std::vector<float>{1, -3, 0, 4, 4, 4}));
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_TRUE(merged.directions[2 * i] == photons.directions[4 * i] ||
                merged.directions[2 * i] == photons.directions[4 * i + 2]);
  }
}

TEST(MergePhotonsTest, NothingIsLostOnAnyCloud) {
  for (const CloudShape& shape : AllClouds()) {
    for (const std::size_t count : {1u, 2u, 17u, 2003u}) {
      const Photons photons = MakeCloud(shape, count, /*seed=*/3);
      for (const BuilderKind kind : {BuilderKind::kLbvh, BuilderKind::kBalanced}) {
        const auto tree = *(*CpuBuilder().Build(photons, {.builder = kind}))->ReadTree();
        for (const std::uint32_t size : {1u, 2u, 8u, 64u}) {
          SCOPED_TRACE(shape.name + " " + std::to_string(count) + " by " + std::to_string(size));
          const Photons merged = MergePhotons(tree, photons, size);
          ASSERT_GE(merged.size(), (count + size - 1) / size);
          ASSERT_LE(merged.size(), count);
          if (size == 1) {
            ASSERT_EQ(merged.size(), count);
          }
          ASSERT_EQ(merged.powers.size(), 3 * merged.size());
          ASSERT_EQ(merged.directions.size(), 2 * merged.size());
          const auto before = TotalPower(photons), after = TotalPower(merged);
          for (int c = 0; c < 3; ++c) ASSERT_NEAR(after[c], before[c], 1e-6 * before[c]);
          const Box bounds = {{tree.root.min[0], tree.root.min[1], tree.root.min[2]},
                              {tree.root.max[0], tree.root.max[1], tree.root.max[2]}};
          for (std::size_t i = 0; i < merged.size(); ++i) {
            Box grown = bounds;
            grown.Extend(merged.position(i));
            ASSERT_EQ(grown, bounds) << i;
          }
          ASSERT_EQ(MergePhotons(tree, photons, size).positions, merged.positions);
        }
      }
    }
  }
}

TEST(GatherMergedTest, QueriesThatFindFewAreExact) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 5003, /*seed=*/1);
  const auto positions = MakeQueries(photons, 400, /*seed=*/2);
  MergedMaps maps(CpuBuilder(), photons);
  for (const GatherOptions& options : {GatherOptions{.k = 100, .radius = 0.2f, .outputs = kSums},
                                       GatherOptions{.k = 0, .radius = 0.2f, .outputs = kSums}}) {
    const auto merged = maps.Merged(8);
    const auto answer = GatherMerged(maps.map(), merged, {.positions = positions}, options);
    ASSERT_TRUE(answer.ok()) << answer.status();
    const auto exact = *maps.map().Gather({.positions = positions}, options);
    std::size_t merged_count = 0;
    for (std::size_t i = 0; i < 400; ++i) {
      merged_count += answer->merged[i];
      if (answer->merged[i] == 0) {
        ASSERT_EQ(answer->counts[i], exact.counts[i]);
        ASSERT_EQ(answer->radii[i], exact.radii[i]);
        for (std::size_t c = 3 * i; c < 3 * i + 3; ++c) {
          ASSERT_EQ(answer->densities[c], exact.densities[c]);
        }
      } else {
        ASSERT_NEAR(answer->counts[i], exact.counts[i], 0.4 * exact.counts[i] + 16);
        ASSERT_NEAR(answer->radii[i], exact.radii[i], 0.25 * exact.radii[i]);
      }
    }
    EXPECT_GT(merged_count, 50u);
    EXPECT_LT(merged_count, 390u);  // MakeQueries goes far outside, too
  }
}

/// RMS over queries of |density / exact density - 1|, of the sum of the channels.
double ErrorOf(const GatherResult& answer, const GatherResult& exact) {
  double sum = 0;
  const std::size_t count = exact.densities.size() / 3;
  for (std::size_t i = 0; i < count; ++i) {
    const auto total = [i](const GatherResult& result) {
      return std::accumulate(&result.densities[3 * i], &result.densities[3 * i] + 3, 0.0);
    };
    const double is = total(answer), should_be = total(exact);
    if (is != should_be) sum += should_be == 0 ? 1 : std::pow(is / should_be - 1, 2);
  }
  return std::sqrt(sum / static_cast<double>(count));
}

TEST(ChooseMergeTest, BatchesKeepTheirErrorOnEveryCloud) {
  const std::uint32_t seed = std::random_device{}();
  std::size_t batches = 0, within = 0, merged = 0;
  std::string outside;
  const auto brute_force = MakeBruteForceBuilder();
  for (const CloudShape& shape : AllClouds()) {
    const Photons photons = MakeCloud(shape, 8009, seed);
    const auto truth = *brute_force->Build(photons, {});
    MergedMaps maps(CpuBuilder(), photons);
    std::vector<float> positions = MakeQueries(photons, 800, seed + 1), normals;
    for (std::size_t i = 0; i < 800; ++i) normals.insert(normals.end(), {0, 0.6f, -0.8f});
    const float radius = MedianRadius(maps.map(), {.positions = positions}, 300);
    for (const GatherOptions& asked :
         {GatherOptions{.k = 300, .outputs = kOutputDensity},
          GatherOptions{.k = 0, .radius = radius, .outputs = kOutputDensity}}) {
      for (const bool has_normals : {false, true}) {
        GatherQueries queries{.positions = positions};
        if (has_normals) queries.normals = normals;
        const auto exact = *truth->Gather(queries, asked);
        for (const float error : {0.02f, 0.1f}) {
          GatherOptions options = asked;
          options.approximation.max_relative_error = error;
          const MergeChoice choice = maps.Choose(queries, options);
          EXPECT_EQ(choice.exact(), choice.reason != ExactReason::kNone);
          ++batches;
          if (choice.exact()) {
            ++within;
            continue;
          }
          ++merged;
          EXPECT_LE(choice.measured_error, choice.error_limit);
          EXPECT_LE(choice.error_limit, error);
          const double is =
              ErrorOf(*GatherMerged(maps.map(), choice.merged, queries, options), exact);
          if (is <= error) {
            ++within;
          } else {
            outside += shape.name + (has_normals ? " with normals" : "") + " k " +
                       std::to_string(asked.k) + ": " + std::to_string(is) + " of " +
                       std::to_string(error) + "; ";
          }
        }
      }
    }
  }
  EXPECT_GE(static_cast<double>(within), 0.95 * static_cast<double>(batches))
      << "seed " << seed << ": " << outside;
  EXPECT_GE(merged, batches / 5) << "seed " << seed;  // else it is exact for want of trying
}

TEST(ChooseMergeTest, SaysWhyABatchIsExact) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 20011, /*seed=*/5);
  const auto positions = MakeQueries(photons, 2000, /*seed=*/6);
  MergedMaps maps(CpuBuilder(), photons);
  const GatherQueries all{.positions = positions},
      few{.positions = std::span(positions).first(3 * 400)};
  const auto asks = [](std::uint32_t k, float error) {
    return GatherOptions{
        .k = k, .outputs = kOutputDensity, .approximation = {.max_relative_error = error}};
  };
  EXPECT_EQ(maps.Choose(few, asks(500, 0.1f)).reason, ExactReason::kFewQueries);
  EXPECT_EQ(maps.Choose(all, asks(10, 0.1f)).reason, ExactReason::kFewPhotons);
  const MergeChoice strict = maps.Choose(all, asks(500, 0.015f));
  EXPECT_EQ(strict.reason, ExactReason::kErrorTooBig);
  EXPECT_GT(strict.error_limit, 0.015f);
  EXPECT_EQ(strict.merged.map, nullptr);
  const auto no_memory = [](const FewerPhotons&) -> absl::StatusOr<MapOfFewer> {
    return absl::ResourceExhaustedError("none");
  };
  EXPECT_EQ(ChooseMerge(maps.map(), no_memory, PlainCosts, all, asks(500, 0.1f))->reason,
            ExactReason::kNoMemory);
  const auto failed = [](const FewerPhotons&) -> absl::StatusOr<MapOfFewer> {
    return absl::InternalError("broken");
  };
  EXPECT_TRUE(
      absl::IsInternal(ChooseMerge(maps.map(), failed, PlainCosts, all, asks(500, 0.1f)).status()));
}

TEST(ChooseMergeTest, AGroupSizeThatIsAskedForIsMeasured) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 20011, /*seed=*/5);
  const auto positions = MakeQueries(photons, 900, /*seed=*/6);
  MergedMaps maps(CpuBuilder(), photons);
  const GatherOptions options{
      .k = 500, .outputs = kOutputDensity, .approximation = {.merged_photons = 16}};
  const MergeChoice choice = maps.Choose({.positions = positions}, options);
  EXPECT_EQ(choice.fewer, (FewerPhotons{FewerPhotons::Kind::kMerged, 16}));
  EXPECT_EQ(choice.sampled, 29u);  // one in 32
  EXPECT_GT(choice.measured_error, 0);
  // The same batch, the same choice.
  EXPECT_EQ(maps.Choose({.positions = positions}, options).measured_error, choice.measured_error);
}

TEST(ThinPhotonsTest, OneOfEachRunStaysWithThePowerOfAll) {
  for (const std::size_t count : {0u, 1u, 7u, 8u, 9u, 2003u}) {
    const Photons photons = MakeCloud(CloudNamed("uniform"), count, /*seed=*/3);
    for (const std::uint32_t size : {1u, 2u, 8u, 64u}) {
      SCOPED_TRACE(std::to_string(count) + " by " + std::to_string(size));
      const Photons kept = ThinPhotons(photons, size);
      ASSERT_GE(kept.size(), count / size);
      ASSERT_LE(kept.size(), (count + size - 1) / size);
      std::size_t photon = 0;
      for (std::size_t i = 0; i < kept.size(); ++i) {
        while (photon < count && photons.position(photon) != kept.position(i)) ++photon;
        ASSERT_LT(photon, count);  // in the same order
        ASSERT_EQ(photon / size, i);
        for (std::size_t c = 0; c < 3; ++c) {
          const double times = static_cast<double>(count) / static_cast<double>(kept.size());
          ASSERT_FLOAT_EQ(kept.powers[3 * i + c],
                          static_cast<float>(times * photons.powers[3 * photon + c]));
        }
        ASSERT_EQ(kept.directions[2 * i], photons.directions[2 * photon]);
        ASSERT_EQ(kept.directions[2 * i + 1], photons.directions[2 * photon + 1]);
      }
      if (size == 1) {
        EXPECT_EQ(kept.powers, photons.powers);
      }
    }
  }
}

TEST(ThinPhotonsTest, EachPlaceOfARunIsAsLikely) {
  constexpr std::size_t kRuns = 20'000;
  constexpr std::uint32_t kSize = 8;
  Photons photons;
  for (std::size_t i = 0; i < kRuns * kSize; ++i) {
    photons.positions.insert(photons.positions.end(), {static_cast<float>(i % kSize), 0, 0});
  }
  photons.powers = photons.positions;
  const Photons kept = ThinPhotons(photons, kSize);
  std::vector<std::size_t> counts(kSize);
  for (std::size_t i = 0; i < kept.size(); ++i) {
    ++counts[static_cast<std::size_t>(kept.position(i).x)];
  }
  // Five standard deviations.
  const double expected = kRuns / double{kSize}, margin = 5 * std::sqrt(expected);
  for (const std::size_t count : counts) EXPECT_NEAR(static_cast<double>(count), expected, margin);
}

TEST(ThinPhotonsTest, DensitiesErrAsTheirNumberSaysAndMoreThanMergedOnes) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 50021, /*seed=*/5);
  const auto positions = MakeQueries(photons, 2000, /*seed=*/6);
  MergedMaps maps(CpuBuilder(), photons);
  for (const std::uint32_t size : {4u, 16u}) {
    GatherOptions options{.k = 500, .outputs = kSums, .approximation = {.thinned_photons = size}};
    const MergeChoice choice = maps.Choose({.positions = positions}, options);
    ASSERT_EQ(choice.fewer, (FewerPhotons{FewerPhotons::Kind::kThinned, size}));
    const auto exact = *maps.map().Gather({.positions = positions}, {.k = 500, .outputs = kSums});
    const auto error_of = [&](const MapOfFewer& fewer) {
      return ErrorOf(*GatherMerged(maps.map(), fewer, {.positions = positions}, options), exact);
    };
    const double error = error_of(choice.merged);
    EXPECT_NEAR(choice.measured_error, error, 0.5 * error);
    const double told = std::sqrt(4.0 / 3 * (size - 1) / 500.0);
    EXPECT_GT(error, 0.5 * told) << size;
    EXPECT_LT(error, 2 * told) << size;
    EXPECT_LT(error_of(maps.Merged(size)), error / 2) << size;
  }
}

TEST(ChooseMergeTest, DevicesMergeAsTheCpuDoes) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 5003, /*seed=*/9);
  const auto positions = MakeQueries(photons, 1200, /*seed=*/10);
  const GatherOptions options{
      .k = 300, .outputs = kSums, .approximation = {.max_relative_error = 0.1f}};
  MergedMaps on_cpu(CpuBuilder(), photons), on_device(TestBuilder(), photons);
  const MergeChoice cpu = on_cpu.Choose({.positions = positions}, options);
  const MergeChoice device = on_device.Choose({.positions = positions}, options);
  ASSERT_FALSE(cpu.exact());
  ASSERT_EQ(device.fewer, cpu.fewer);
  const auto expected = *GatherMerged(on_cpu.map(), cpu.merged, {.positions = positions}, options);
  const auto answer =
      *GatherMerged(on_device.map(), device.merged, {.positions = positions}, options);
  EXPECT_TRUE(SameArray("counts", answer.counts, expected.counts));
  EXPECT_TRUE(SameArray("radii", answer.radii, expected.radii));
  EXPECT_TRUE(SameArray("merged", answer.merged, expected.merged));
  EXPECT_LT(ErrorOf(answer, expected), 1e-5);
}

TEST(ApproximationTest, WrongValuesAreRefused) {
  const Photons photons = MakeCloud(CloudNamed("uniform"), 100, /*seed=*/1);
  const auto map = *CpuBuilder().Build(photons, {});
  const std::vector<float> positions = {0, 0, 0};
  const auto refused = [&](const Approximation& approximation, std::uint32_t outputs) {
    const GatherOptions options{.k = 5, .outputs = outputs, .approximation = approximation};
    return std::string(CheckGather(*map, {.positions = positions}, options).message());
  };
  using testing::HasSubstr;
  EXPECT_THAT(refused({.max_relative_error = -0.5f}, kOutputDensity),
              HasSubstr("max_relative_error is -0.5, it must be in [0, 1)"));
  EXPECT_THAT(refused({.max_relative_error = NAN}, kOutputDensity), HasSubstr("is nan"));
  EXPECT_THAT(refused({.max_relative_error = 1}, kOutputDensity), HasSubstr("is 1, it must be"));
  EXPECT_THAT(refused({.merged_photons = 3}, kOutputDensity),
              HasSubstr("merged_photons is 3, it must be 0 or a power of two in [2, 64]"));
  EXPECT_THAT(refused({.merged_photons = 1}, kOutputDensity), HasSubstr("merged_photons is 1"));
  EXPECT_THAT(refused({.merged_photons = 128}, kOutputDensity), HasSubstr("is 128"));
  EXPECT_THAT(refused({.merged_photons = 4, .max_relative_error = 0.5f}, kOutputDensity),
              HasSubstr("max_relative_error is 0.5, which goes with no other field"));
  EXPECT_THAT(refused({.epsilon = 1, .merged_photons = 4}, kOutputDensity),
              HasSubstr("merged_photons is 4, which goes with no other field"));
  EXPECT_THAT(refused({.thinned_photons = 5}, kOutputDensity),
              HasSubstr("thinned_photons is 5, it must be 0 or a power of two in [2, 64]"));
  EXPECT_THAT(refused({.merged_photons = 4, .thinned_photons = 4}, kOutputDensity),
              HasSubstr("merged_photons is 4, which goes with no other field"));
  EXPECT_THAT(refused({.epsilon = 1, .thinned_photons = 4}, kOutputDensity),
              HasSubstr("thinned_photons is 4, which goes with no other field"));
  EXPECT_THAT(refused({.thinned_photons = 4}, kOutputCount),
              HasSubstr("thinned_photons is 4, but outputs is 1: it is for DENSITY"));
  EXPECT_THAT(refused({.max_relative_error = 0.5f}, kOutputCount),
              HasSubstr("but outputs is 1: it is for DENSITY"));
  EXPECT_THAT(refused({.max_relative_error = 0.5f}, kOutputDensity | kOutputNeighbors),
              HasSubstr("but outputs is 12: it is for DENSITY"));
  EXPECT_EQ(refused({.max_relative_error = 0.5f}, kSums), "");
}

}  // namespace
}  // namespace treelight
