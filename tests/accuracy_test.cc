// What `treelight accuracy` measures: the truth, the distance from it, and a small run.

#include "client/accuracy/accuracy.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "client/accuracy/truth.h"
#include "client/scenes/load_scene.h"
#include "core/model/octahedral.h"
#include "tests/server_fixture.h"

namespace treelight::client {
namespace {

/// Photons on the x axis at 1, 2, 3 with a power of 1 in each channel.
Photons OnALine() {
  return {.positions = {1, 0, 0, 2, 0, 0, 3, 0, 0},
          .powers = std::vector<float>(9, 1.0f),
          .directions = {}};
}

TEST(TruthTest, AWorkedExample) {
  const std::vector<float> queries = {0, 0, 0};
  // Of the two nearest at 1 and 2 the second weighs nothing: 3 channels * 2 (1 - 1/4) / (4 pi).
  const auto nearest = ComputeTruth(OnALine(), {.positions = queries}, 2, INFINITY);
  ASSERT_EQ(nearest.size(), 1u);
  EXPECT_DOUBLE_EQ(nearest[0].distance, 2);
  EXPECT_DOUBLE_EQ(nearest[0].density, 3 * 2 * 0.75 / (4 * M_PI));
  // Within 4: weights of 15, 12 and 7 sixteenths, twice.
  const auto within = ComputeTruth(OnALine(), {.positions = queries}, 0, 4);
  EXPECT_DOUBLE_EQ(within[0].density, 3 * 2 * (34.0 / 16) / (16 * M_PI));
}

TEST(TruthTest, NormalsLeaveOutWhatComesFromBehind) {
  Photons photons = OnALine();
  for (const float z : {-1.0f, 1.0f, -1.0f}) {
    const auto direction = EncodeOctahedral({0, 0, z});
    photons.directions.insert(photons.directions.end(), direction.begin(), direction.end());
  }
  const std::vector<float> positions = {0, 0, 0}, normals = {0, 0, 1};
  // Within 4, of weights of 15, 12 and 7 sixteenths, twice, without the second; radii are of all.
  const auto truth = ComputeTruth(photons, {.positions = positions, .normals = normals}, 0, 4);
  EXPECT_DOUBLE_EQ(truth[0].density, 3 * 2 * (22.0 / 16) / (16 * M_PI));
  const auto nearest = ComputeTruth(photons, {.positions = positions, .normals = normals}, 2, 9);
  EXPECT_DOUBLE_EQ(nearest[0].distance, 2);
}

TEST(TruthTest, AnAnswerThatIsWrongIsToldSo) {
  const std::vector<float> queries = {0, 0, 0};
  const auto truth = ComputeTruth(OnALine(), {.positions = queries}, 2, INFINITY);
  const auto third = static_cast<float>(truth[0].density / 3);
  GatherResult answer;
  answer.radii = {2};
  answer.neighbor_ids = {0, 1};
  answer.densities = {third, third, third};
  const AnswerError none = CompareAnswers(OnALine(), queries, answer, truth, 2);
  EXPECT_EQ(none.distance, 0);
  EXPECT_EQ(none.recall, 1);
  EXPECT_NEAR(none.density, 0, 1e-7);
  // The third photon instead of the second.
  answer.radii = {3};
  answer.neighbor_ids = {0, 2};
  answer.densities = {2 * third, third, third};
  answer.error_bounds = {0.5f};
  const AnswerError error = CompareAnswers(OnALine(), queries, answer, truth, 2);
  EXPECT_DOUBLE_EQ(error.distance, 0.5);
  EXPECT_DOUBLE_EQ(error.recall, 0.5);
  EXPECT_NEAR(error.density, 1.0 / 3, 1e-6);
  EXPECT_DOUBLE_EQ(error.bound, 0.5);
}

TEST(DensityErrorTest, AWorkedExample) {
  GatherResult answer, exact;
  answer.densities = {1, 1, 2, 0, 0, 0, 1, 0, 0};
  exact.densities = {2, 1, 2, 0, 0, 0, 0, 0, 0};
  // 1/5 too low, right, and something where there is nothing.
  EXPECT_NEAR(DensityError(answer, exact), std::sqrt((0.04 + 0 + 1) / 3), 1e-7);
}

class AccuracyTest : public treelight::testing::ServerTest {
 protected:
  /// Measures `plan` of the scene "cornell" by a server of the CPU.
  std::vector<AccuracyRow> Measure(const AccuracyPlan& plan) {
    Start(MakeCpuBuilder());
    PhotonMapClient client(server_->InProcessChannel());
    auto scene = LoadScene("cornell");
    EXPECT_TRUE(scene.ok()) << scene.status();
    if (!scene.ok()) return {};
    std::vector<AccuracyRow> rows;
    const auto status =
        MeasureAccuracy(client, std::move(scene->scene), plan, [&](const AccuracyRow& row) {
          rows.push_back(row);
          return absl::OkStatus();
        });
    EXPECT_TRUE(status.ok()) << status;
    return rows;
  }
};

TEST_F(AccuracyTest, ExactRowsAreRightAndOthersErrMoreTheMoreIsGivenUp) {
  const AccuracyPlan plan{.photons = 5'000,
                          .caustic_photons = 1'000,
                          .queries = 300,
                          .checked = 100,
                          .runs = 1,
                          .ks = {50},
                          .errors = {0.2},
                          .batches = 2,
                          .picture_size = 8,
                          .reference_spp = 4};
  const std::vector<AccuracyRow> rows = Measure(plan);
  ASSERT_EQ(rows.size(), SettingGrid(plan.ks, plan.errors).size());
  double last = 0, merged_error = 1;
  for (const AccuracyRow& row : rows) {
    SCOPED_TRACE(AccuracyCsvLine(row));
    EXPECT_GT(row.speed.whole_ns, 0);
    const Knob knob = row.setting.knob;
    if (knob == Knob::kNone || knob == Knob::kRadius || knob == Knob::kWeightTolerance) {
      EXPECT_LT(row.error.density, 1e-5);
      EXPECT_LT(row.error.distance, 1e-6);
      EXPECT_EQ(row.error.recall, 1);
    }
    if (knob == Knob::kMergedWithin && row.setting.value == 2) {
      EXPECT_EQ(row.merge.merged_photons, 2u);
      EXPECT_GT(row.error.density, 0);
      EXPECT_LT(row.error.density, 0.2);
      merged_error = row.error.density;
    }
    // Positions and densities: 12 bytes each, or half of that, and what goes with each message.
    const bool quantized = knob == Knob::kQuantized || knob == Knob::kCompact;
    const bool halves = knob == Knob::kHalves || knob == Knob::kCompact;
    EXPECT_NEAR(row.speed.request_bytes, quantized ? 6 : 12, 0.5);
    EXPECT_NEAR(row.speed.answer_bytes, halves ? 6 : 12, 1);  // of few queries: times and texts
    if (quantized || halves) {
      EXPECT_GT(row.error.density, 1e-6);
      EXPECT_LT(row.error.density, 1e-3);
      EXPECT_LT(row.error.distance, 1e-3);
      EXPECT_GT(row.error.recall, 0.999);
    }
    if (knob == Knob::kThinnedWithin && row.setting.value == 2) {
      EXPECT_EQ(row.merge.merged_photons, 2u);
      EXPECT_GT(row.error.density, merged_error);
    }
    if (AsksForError(knob)) {
      EXPECT_EQ(row.merge.batches, 2u);
      EXPECT_EQ(row.merge.batches_within, 2u);
    }
    if (knob == Knob::kEpsilon) {
      EXPECT_GE(row.error.distance, last);
      EXPECT_LE(row.error.distance, row.setting.value);
      last = row.error.distance;
      EXPECT_GT(row.picture.seconds, 0);
      EXPECT_GT(row.picture.rmse, 0);
    }
  }
  EXPECT_GT(last, 0);
}

TEST_F(AccuracyTest, ExactRowsAreRightWithNormalsToo) {
  const AccuracyPlan plan{.photons = 5'000,
                          .caustic_photons = 0,
                          .queries = 300,
                          .normals = true,
                          .checked = 100,
                          .runs = 1,
                          .ks = {50},
                          .errors = {0.2},
                          .batches = 2,
                          .picture_size = 0};
  std::vector<Knob> exact;
  for (const AccuracyRow& row : Measure(plan)) {
    SCOPED_TRACE(AccuracyCsvLine(row));
    EXPECT_TRUE(row.normals);
    EXPECT_NE(row.setting.knob, Knob::kWeightTolerance);
    if (row.setting.knob == Knob::kNone || row.setting.knob == Knob::kRadius) {
      exact.push_back(row.setting.knob);
      EXPECT_LT(row.error.density, 1e-5);
      EXPECT_NEAR(row.speed.request_bytes, 24, 0.5);
    }
    if (row.setting.knob == Knob::kMergedWithin && row.setting.value == 2) {
      EXPECT_GT(row.error.density, 0);
      EXPECT_LT(row.error.density, 0.2);
    }
  }
  EXPECT_EQ(exact, (std::vector<Knob>{Knob::kNone, Knob::kRadius}));
}

TEST(AccuracyRowTest, ALineHasAsManyCellsAsTheHeader) {
  AccuracyRow row;
  row.device = "a, b";
  const std::string header = AccuracyCsvHeader();
  const std::string line = AccuracyCsvLine(row);
  EXPECT_EQ(std::count(line.begin(), line.end(), ','),
            std::count(header.begin(), header.end(), ','));
}

}  // namespace
}  // namespace treelight::client
