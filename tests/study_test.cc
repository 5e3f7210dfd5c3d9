#include "client/study/study.h"

#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "client/remote_map.h"
#include "client/study/hard_inputs.h"
#include "client/study/sample.h"
#include "client/study/study_row.h"
#include "client/study/study_scene.h"
#include "client/study/summary.h"
#include "client/trace/intersector.h"
#include "gmock/gmock.h"
#include "tests/server_fixture.h"

namespace treelight::client {
namespace {

using ::testing::HasSubstr;

/// A row of the light photons of "room" by seed, whose searches visit `nodes` and test `tests`.
StudyRow Row(const std::string& builder, std::uint32_t seed, double nodes, double tests,
             std::uint32_t leaf_size = 8) {
  return {.photons = {.scene = "room", .set = "light", .camera = {}, .seed = seed, .photons = 1000},
          .variant = {.builder = builder},
          .leaf_size = leaf_size,
          .sah_cost = nodes,
          .isa_cost = 2 * nodes,
          .depth = 10 + seed,
          .leaf_fill = 5,
          .searches = {.exact_nodes = nodes,
                       .knn50_nodes = nodes,
                       .knn50_tests = tests,
                       .r50_nodes = nodes,
                       .r50_tests = tests},
          .build_ms = 1,
          .device = "d"};
}

TEST(EstimateMeanTest, IsStudentsInterval) {
  const double values[] = {98, 101, 100, 99, 102};
  const Estimate estimate = EstimateMean(values);
  EXPECT_DOUBLE_EQ(estimate.mean, 100);
  EXPECT_NEAR(estimate.half_width, 2.776 * std::sqrt(2.5 / 5), 1e-9);  // t with 4 degrees
  EXPECT_EQ(EstimateMean(std::span(values).first(1)).half_width,
            std::numeric_limits<double>::infinity());
  EXPECT_EQ(EstimateMean({}).mean, 0);
}

TEST(SummariseTest, IsRelativeToTheBaselineOverTheSamePhotons) {
  const std::vector<StudyRow> rows = {Row("karras", 1, 100, 50), Row("isa", 1, 80, 60),
                                      Row("karras", 2, 200, 50), Row("isa", 2, 100, 40),
                                      Row("isa", 3, 1, 1)};  // no baseline
  const auto summary = Summarise(rows);
  ASSERT_EQ(summary.size(), 2u);
  EXPECT_EQ(summary[0].variant.builder, "karras");
  EXPECT_EQ(summary[0].knn50_speed.mean, 100);
  EXPECT_EQ(summary[1].seeds, 2u);
  EXPECT_DOUBLE_EQ(summary[1].sah.mean, (80 + 50) / 2.0);
  EXPECT_DOUBLE_EQ(summary[1].knn50_speed.mean, (125 + 200) / 2.0);
  EXPECT_NEAR(summary[1].knn50_speed.half_width, 12.706 * 37.5, 1e-6);
  EXPECT_DOUBLE_EQ(summary[1].knn50_tests.mean, (120 + 80) / 2.0);
  EXPECT_EQ(summary[1].max_depth, 12u);
}

TEST(SummariseTest, CamerasOfASeedCountOnce) {
  std::vector<StudyRow> rows = {Row("karras", 1, 100, 50), Row("isa", 1, 50, 50),
                                Row("karras", 1, 100, 50), Row("isa", 1, 100, 50)};
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i].photons.camera = i < 2 ? "front" : "back";
  const auto summary = Summarise(rows);
  EXPECT_EQ(summary[1].seeds, 1u);
  EXPECT_DOUBLE_EQ(summary[1].exact_speed.mean, 150);
}

// With nodes = 1000 / tests the curve is a line in logarithms.
TEST(SummariseTest, EqualTestsAreInterpolatedOverLeafSizes) {
  const std::vector<StudyRow> rows = {Row("karras", 1, 10, 100, 4), Row("karras", 1, 5, 200, 8),
                                      Row("karras", 1, 2.5, 400, 16), Row("isa", 1, 4, 150, 8),
                                      Row("isa", 1, 4, 401, 16)};
  const auto summary = Summarise(rows);
  ASSERT_EQ(summary.size(), 5u);
  EXPECT_NEAR(summary[3].knn50_speed_at_equal_tests.mean, 100 * (1000 / 150.0) / 4, 1e-9);
  EXPECT_EQ(summary[4].knn50_speed_at_equal_tests.mean, 0);  // beyond the curve
  EXPECT_NEAR(summary[1].knn50_speed_at_equal_tests.mean, 100, 1e-9);
}

TEST(StudyCsvTest, RowsComeBackAsTheyWent) {
  StudyRow row = Row("treelet", 4, 1.5, 2.25);
  row.variant = {.builder = "treelet",
                 .heuristic = "isa",
                 .leaf_term = "leaf_size",
                 .treelet_size = 7,
                 .rounds = 3};
  row.photons.camera = "back";
  const auto rows =
      ParseStudyCsv(StudyCsvHeader() + StudyCsvLine(row) + StudyCsvLine(row), "s.csv");
  ASSERT_TRUE(rows.ok()) << rows.status();
  EXPECT_EQ(*rows, (std::vector{row, row}));
  EXPECT_THAT(StudyCsvHeader(),
              HasSubstr("scene,set,seed,photons,builder,heuristic,treelet_size,rounds,leaf_size,"
                        "sah_cost,isa_cost,depth,leaf_fill,exact_nodes,knn50_nodes,knn50_tests,"
                        "r50_nodes,r50_tests,build_ms,device"));
}

TEST(StudyCsvTest, ErrorsNameLineAndColumn) {
  const std::string good = StudyCsvHeader() + StudyCsvLine(Row("isa", 1, 2, 3));
  EXPECT_THAT(ParseStudyCsv("a,b\n", "s.csv").status().message(),
              HasSubstr("s.csv:1: the columns are not those of a study"));
  EXPECT_EQ(ParseStudyCsv(good + "room,light,x\n", "s.csv").status().message(),
            "s.csv:3: seed is 'x', no number");
  EXPECT_EQ(ParseStudyCsv(good + "room\n", "s.csv").status().message(),
            "s.csv:3: the line ends before set");
}

TEST(StudyVariantsTest, TheBaselineIsFirstAndNoTwoAreTheSame) {
  for (const auto choice : {VariantChoice::kAll, VariantChoice::kFew, VariantChoice::kCurve}) {
    for (const std::uint32_t leaf_size : {1u, 8u}) {
      std::set<Variant> different;
      std::set<std::string> labels;
      const auto variants = StudyVariants(choice, leaf_size);
      EXPECT_TRUE(IsBaseline(variants[0]));
      for (const Variant& variant : variants) {
        EXPECT_TRUE(different.insert(variant).second) << Label(variant);
        EXPECT_TRUE(labels.insert(Label(variant)).second) << Label(variant);
        EXPECT_TRUE(leaf_size > 1 || variant.leaf_term != "leaf_size") << Label(variant);
      }
    }
  }
}

TEST(StudySceneTest, AStandInSaysSo) {
  for (const std::string& name : StudySceneNames()) {
    const auto study = LoadStudyScene(name, "/nowhere");
    ASSERT_TRUE(study.ok()) << study.status();
    EXPECT_NE(study->name, name);
    EXPECT_THAT(study->note, HasSubstr("stands in for " + name + ": there is no \"/nowhere/"));
    for (const Material& material : study->scene.materials) {
      EXPECT_EQ(material.surface, Surface::kDiffuse);
      EXPECT_EQ(material.reflectance.r, kStudyAlbedo);
    }
    // Both cameras see something, each another half of it.
    const auto intersector = Intersector::Create(study->scene);
    ASSERT_TRUE(intersector.ok()) << intersector.status();
    Vec3 views[2];
    for (int i = 0; i < 2; ++i) {
      const Camera& camera = study->cameras[i];
      views[i] = {camera.target.x - camera.position.x, camera.target.y - camera.position.y,
                  camera.target.z - camera.position.z};
      const float length = std::hypot(views[i].x, views[i].y, views[i].z);
      views[i] = {views[i].x / length, views[i].y / length, views[i].z / length};
      EXPECT_TRUE(intersector->Intersect({camera.position, views[i]})) << name << " " << i;
    }
    EXPECT_LT(views[0].x * views[1].x + views[0].z * views[1].z, -0.5f) << name;
  }
  EXPECT_EQ(LoadStudyScene("kitchen", "").status().message(),
            "there is no scene \"kitchen\" in the study; it has sibenik, dragon, conference");
}

TEST(SamplePositionsTest, TakesPositionsOfTheSet) {
  const std::vector<float> positions = {0, 1, 2, 3, 4, 5};
  const auto chosen = SamplePositions(positions, 100, 1);
  ASSERT_EQ(chosen.size(), 300u);
  int first = 0;
  for (std::size_t i = 0; i < chosen.size(); i += 3) {
    EXPECT_TRUE(chosen[i] == 0 || chosen[i] == 3);
    EXPECT_EQ(chosen[i + 1], chosen[i] + 1);
    first += chosen[i] == 0;
  }
  EXPECT_GT(first, 30);
  EXPECT_LT(first, 70);
  EXPECT_EQ(SamplePositions(positions, 100, 1), chosen);
  EXPECT_TRUE(SamplePositions({}, 100, 1).empty());
}

/// On a server whose trees are built on the CPU.
class StudyOnServerTest : public ::treelight::testing::ServerTest {
 protected:
  /// What the plan measures; nothing is left on the server.
  std::vector<StudyRow> Run(const StudyPlan& plan) {
    Start(MakeCpuBuilder());
    PhotonMapClient client(server_->InProcessChannel());
    std::vector<StudyRow> rows;
    const auto status =
        RunStudy(client, plan,
                 {.row =
                      [&](const StudyRow& row) {
                        rows.push_back(row);
                        return absl::OkStatus();
                      },
                  .note = [&](const std::string& note) { notes_.push_back(note); }});
    EXPECT_TRUE(status.ok()) << status;
    EXPECT_TRUE(client.ListPhotonMaps()->empty());
    return rows;
  }

  std::vector<std::string> notes_;
};

TEST_F(StudyOnServerTest, SearchesAreThoseOfTheMapItself) {
  Start(MakeCpuBuilder());
  const Photons photons = ::treelight::testing::MakePhotons(3000, 1);
  const auto map = MustBuild("cloud", photons);
  PhotonMapClient client(server_->InProcessChannel());
  const auto queries = SamplePositions(photons.positions, 100, 1);
  const auto remote = MeasureSearches(RemoteMap(client, map), queries);
  const auto local = MeasureSearches(**MakeCpuBuilder()->Build(photons, {}), queries);
  ASSERT_TRUE(remote.ok()) << remote.status();
  EXPECT_EQ(*remote, *local);
  EXPECT_GT(remote->knn50_tests, 50);
}

// What the study is about, on few photons: fuller leaves of the right shape are found faster, and
// surface area is no measure of that.
TEST_F(StudyOnServerTest, TheAnswerShowsOnFewPhotons) {
  const auto rows = Run({.scenes = {"conference"},
                         .scene_folder = {},
                         .seeds = 2,
                         .queries = 300,
                         .image_photons = 10'000,
                         .light_photons = {20'000},
                         .leaf_sizes = {4, 8, 16},
                         .hard_photons = 0});
  ASSERT_EQ(notes_.size(), 1u);
  EXPECT_THAT(notes_[0], HasSubstr("the built-in scene room stands in for conference"));
  std::map<std::pair<std::string, std::string>, SummaryRow> found;
  for (const SummaryRow& row : Summarise(rows)) {
    if (row.leaf_size == (row.set == "image" ? 1u : 8u)) found[{row.set, Label(row.variant)}] = row;
    EXPECT_EQ(row.seeds, 2u);
  }
  EXPECT_EQ(found.at({"light", "karras"}).knn50_speed.mean, 100);
  EXPECT_GT(found.at({"light", "treelet isa+leaf 7x3"}).knn50_speed.mean, 110);
  EXPECT_GT(found.at({"light", "hybrid isa+leaf 256"}).knn50_speed.mean, 118);
  EXPECT_GT(found.at({"light", "isa+leaf"}).knn50_speed.mean, 120);
  EXPECT_GT(found.at({"light", "isa+leaf"}).r50_speed.mean, 115);
  EXPECT_GT(found.at({"light", "hybrid isa 256"}).r50_speed_at_equal_tests.mean, 103);
  EXPECT_LT(found.at({"light", "treelet sah 7x3"}).knn50_speed.mean,
            1.05 * found.at({"light", "lbvh"}).knn50_speed.mean);
  // The paper's row: the cost falls, searches do not follow.
  const SummaryRow& paper = found.at({"image", "treelet sah 7x1"});
  EXPECT_LT(paper.sah.mean, 95);
  EXPECT_GT(paper.exact_speed.mean, 94);
  EXPECT_LT(paper.exact_speed.mean, 110);
  for (const StudyRow& row : rows) {
    EXPECT_GT(row.isa_cost, row.sah_cost) << Label(row.variant);
    EXPECT_GT(row.build_ms, 0);
    EXPECT_EQ(row.device, "cpu");
  }
}

TEST_F(StudyOnServerTest, HardInputsAreAnsweredOrRefused) {
  const auto rows = Run({.scenes = {}, .scene_folder = {}, .hard_photons = 1000});
  std::set<std::string> names;
  for (const StudyRow& row : rows) names.insert(row.photons.scene);
  EXPECT_EQ(names.size(), MakeHardInputs(2, 1).size() - 1);
  ASSERT_EQ(notes_.size(), 1u);
  EXPECT_THAT(notes_[0], HasSubstr("huge: refused: chunk.positions: number "));
}

TEST_F(StudyOnServerTest, OnlyTheTreesThatAreAskedForAreMeasured) {
  const auto rows = Run({.scenes = {}, .scene_folder = {}, .hard_photons = 100, .labels = {"isa"}});
  std::set<std::string> labels;
  for (const StudyRow& row : rows) labels.insert(Label(row.variant));
  EXPECT_EQ(labels, (std::set<std::string>{"karras", "isa"}));
}

}  // namespace
}  // namespace treelight::client
