// The searches of the wide tree by sub-groups, against brute force, on any machine: the texts of
// their kernels run on the host (work_group.h). That shows wrong answers, items that diverge and
// lists that are overrun. Of races it shows those between two exchanges: here every exchange orders
// memory, on a device sub_group_sync alone does. Nor does it show what a device's compiler makes of
// the text, or its native_ functions: gather_wide_test is for devices.

#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "core/builder.h"
#include "core/gatherer.h"
#include "core/gpu/gpu.h"
#include "gtest/gtest.h"
#include "tests/answers.h"
#include "tests/clouds.h"
#include "tests/emulated/wide_search.h"

namespace treelight::emulated {
namespace {

constexpr std::uint32_t kExact = kOutputCount | kOutputRadius | kOutputNeighbors;
constexpr std::uint32_t kWithin = kOutputCount | kOutputRadius;
constexpr float kUnlimited = std::numeric_limits<float>::infinity();
constexpr std::size_t kQueries = 15;

// As CMakeLists.txt has it.
static_assert(kSubGroupsPerGroup == 2);
static_assert(kGatherWideVariants.many.queries == 4 && kGatherWideVariants.few.queries == 1);
static_assert(kCountWideVariants.many.queries == 8 && kCountWideVariants.few.queries == 2);
static_assert(kDensityWideVariants.many.queries == 4 && kDensityWideVariants.few.queries == 1);
constexpr Program kGatherWide[] = {{"gather_wide", run_gather_wide_4, 4, 2},
                                   {"gather_wide", run_gather_wide_1, 1, 2}};
constexpr Program kGatherLong[] = {{"gather_long", run_gather_long_1, 1, 1},
                                   {"gather_long", run_gather_long_2, 1, 2}};
constexpr Program kCountWide[] = {{"count_wide", run_count_wide_8, 8, 2},
                                  {"count_wide", run_count_wide_2, 2, 2}};
constexpr Program kDensityWide[] = {{"density_wide", run_density_wide_4, 4, 2},
                                    {"density_wide", run_density_wide_1, 1, 2}};

/// Photons, what searches them, and queries.
struct Case {
  Case(const std::string& cloud, std::size_t size)
      : photons(MakeCloud(CloudNamed(cloud), size, /*seed=*/7)),
        positions(MakeQueries(photons, kQueries, /*seed=*/8)),
        normals(MakeQueries(photons, kQueries, /*seed=*/9)) {
    const BuildOptions options{.max_leaf_size = size % 2 == 0 ? 64u : 7u};
    map = ReadMap(**MakeCpuBuilder()->Build(photons, options));
    brute_force = *MakeBruteForceBuilder()->Build(photons, options);
    radius = MedianRadius(*brute_force, {positions}, 50);
    for (std::size_t i = 0; i < kQueries; ++i)
      radii.push_back(radius * static_cast<float>(i % 7) / 3);
  }

  Photons photons;
  std::vector<float> positions, normals, radii;
  Map map;
  std::unique_ptr<Gatherer> brute_force;
  float radius = 0;  ///< within which half of the queries have 50 photons
};

std::string Name(const Program& program, std::size_t size, std::uint32_t k, float radius) {
  return std::string(program.name) + " of " + std::to_string(program.queries) + " queries, " +
         std::to_string(program.sub_groups) + " sub-groups, " + std::to_string(size) +
         " photons, k " + std::to_string(k) + ", radius " + std::to_string(radius);
}

/// Places of a list of gather_long: no more than it needs, so that lists are cut often and sorted
/// by a network, or so many that they are sorted by bins.
std::uint32_t ListSize(std::uint32_t k, std::size_t size, bool is_tight) {
  const std::uint32_t kept = std::min(k, static_cast<std::uint32_t>(size));
  return (kept + (is_tight ? 64 : kept + 96) + 31) / 32 * 32;
}

class EveryCloud : public testing::TestWithParam<std::string> {};

TEST_P(EveryCloud, NearestAreBitEqualToBruteForce) {
  for (const std::size_t size : {1, 33, 1024, 5003}) {
    const Case c(GetParam(), size);
    const GatherQueries queries{.positions = c.positions};
    for (const std::uint32_t k : {17u, 50u, 64u, 129u, 1000u}) {
      for (const float radius : {kUnlimited, c.radius, 0.0f}) {
        const GatherOptions options{.k = k, .radius = radius, .outputs = kExact};
        const GatherResult expected = *c.brute_force->Gather(queries, options);
        for (const Program& program : k > 64 ? kGatherLong : kGatherWide) {
          SCOPED_TRACE(Name(program, size, k, radius));
          for (const bool is_tight : {true, false}) {
            if (k <= 64 && !is_tight) continue;  // has no list of any size
            const GatherResult actual =
                Search(program, c.map, queries, options, ListSize(k, size, is_tight));
            ASSERT_TRUE(SameExactAnswers(actual, expected));
          }
        }
      }
    }
  }
}

TEST_P(EveryCloud, DensitiesOfTheNearestAreWithinTheStatedBound) {
  const std::size_t size = 5003;
  const Case c(GetParam(), size);
  const GatherQueries queries{.positions = c.positions, .normals = c.normals, .radii = c.radii};
  for (const std::uint32_t k : {50u, 200u}) {
    for (const DensityKernel kernel :
         {DensityKernel::kConstant, DensityKernel::kCone, DensityKernel::kEpanechnikov}) {
      const GatherOptions options{.k = k, .outputs = kExact | kOutputDensity, .kernel = kernel};
      const GatherResult expected = *c.brute_force->Gather(queries, options);
      for (const Program& program : k > 64 ? kGatherLong : kGatherWide) {
        SCOPED_TRACE(Name(program, size, k, c.radius));
        const GatherResult actual =
            Search(program, c.map, queries, options, ListSize(k, size, /*is_tight=*/true));
        ASSERT_TRUE(SameExactAnswers(actual, expected));
        ExpectCloseDensities(actual, expected, c.photons, kernel);
      }
    }
  }
}

TEST_P(EveryCloud, CountsWithinARadiusAreThoseOfBruteForce) {
  for (const std::size_t size : {1, 33, 1024, 5003}) {
    const Case c(GetParam(), size);
    const GatherQueries one_radius{.positions = c.positions};
    const GatherQueries own_radii{.positions = c.positions, .radii = c.radii};
    for (const GatherQueries& queries : {one_radius, own_radii}) {
      for (const float radius : {c.radius, 4 * c.radius, 0.0f}) {
        const GatherOptions options{.radius = radius, .outputs = kWithin};
        const GatherResult expected = *c.brute_force->Gather(queries, options);
        for (const Program& program : kCountWide) {
          SCOPED_TRACE(Name(program, size, 0, radius));
          ASSERT_TRUE(SameExactAnswers(Search(program, c.map, queries, options), expected));
        }
      }
    }
  }
}

TEST_P(EveryCloud, DensitiesWithinARadiusAreWithinTheStatedBound) {
  for (const std::size_t size : {1, 33, 1024, 5003}) {
    const Case c(GetParam(), size);
    const GatherQueries plain{.positions = c.positions};
    const GatherQueries facing{.positions = c.positions, .normals = c.normals, .radii = c.radii};
    for (const DensityKernel kernel :
         {DensityKernel::kConstant, DensityKernel::kCone, DensityKernel::kEpanechnikov}) {
      for (const GatherQueries& queries : {plain, facing}) {
        const GatherOptions options{
            .radius = c.radius, .outputs = kWithin | kOutputDensity, .kernel = kernel};
        const GatherResult expected = *c.brute_force->Gather(queries, options);
        for (const Program& program : kDensityWide) {
          SCOPED_TRACE(Name(program, size, 0, c.radius));
          const GatherResult actual = Search(program, c.map, queries, options);
          ASSERT_TRUE(SameExactAnswers(actual, expected));
          ExpectCloseDensities(actual, expected, c.photons, kernel);
        }
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Clouds, EveryCloud, testing::ValuesIn(CloudNames()),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace treelight::emulated
