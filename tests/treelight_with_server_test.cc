// `treelight` against a `treelightd` process, as users run them.
#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <set>
#include <string>
#include <thread>

#include "client/answer_csv.h"
#include "client/photon_ply.h"
#include "client/query_file.h"
#include "core/builder.h"
#include "fmt/format.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "stb_image.h"
#include "tests/server_fixture.h"
#include "tests/treelight_command.h"

namespace treelight::client {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;
using ::treelight::testing::MakePhotons;
using ::treelight::testing::MakePoints;
using ::treelight::testing::Outcome;
using ::treelight::testing::ReadFile;

/// With a `treelightd` process on a free port.
class TreelightWithServerTest : public ::treelight::testing::TreelightCommand {
 protected:
  void SetUp() override {
    const std::string log = Path("server.log"), output = Path("server.out");
    server_ = fork();
    ASSERT_GE(server_, 0);
    if (server_ == 0) {
      const int file = open(output.c_str(), O_CREAT | O_WRONLY | O_TRUNC, 0600);
      dup2(file, STDOUT_FILENO);
      dup2(file, STDERR_FILENO);
      execl(TREELIGHTD_PROGRAM, TREELIGHTD_PROGRAM, "--listen", "127.0.0.1:0", "--log-file",
            log.c_str(), nullptr);
      _exit(127);
    }
    // The kernels may have to be compiled first.
    for (int tenths = 0; tenths < 600 && server_address_.ends_with(":1"); ++tenths) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      ReadAddress(ReadFile(output));
    }
    ASSERT_NE(server_address_, "127.0.0.1:1") << ReadFile(output);
  }

  void TearDown() override {
    if (server_ <= 0) return;
    Stop();
    int status = 0;
    ASSERT_EQ(waitpid(server_, &status, 0), server_);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  }

  /// Lets the server drain; once only, since a second signal would end it at once.
  void Stop() {
    if (!stopped_) kill(server_, SIGTERM);
    stopped_ = true;
  }

  /// Bytes of the upload of a map, which the log tells soon after its answer; 0: it does not.
  std::uint64_t LoggedBuildBytes(const std::string& map) const {
    for (int tries = 0; tries < 1000; ++tries) {
      std::istringstream log(ReadFile(Path("server.log")));
      for (std::string line; std::getline(log, line);) {
        const auto record = nlohmann::json::parse(line, nullptr, /*allow_exceptions=*/false);
        if (record.is_discarded() || record["method"] != "BuildPhotonMap") continue;
        if (record.value("map", "") == map) return record["bytes_in"];
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return 0;
  }

 private:
  void ReadAddress(const std::string& output) {
    const std::string mark = "listening on ";
    const std::size_t first = output.find(mark);
    if (first == output.npos || output.find('\n', first) == output.npos) return;
    const std::size_t begin = first + mark.size();
    server_address_ = output.substr(begin, output.find_first_of(",\n", begin) - begin);
  }

  pid_t server_ = 0;
  bool stopped_ = false;
};

TEST_F(TreelightWithServerTest, AnswersAreThoseOfBruteForceBitByBit) {
  const Photons photons = MakePhotons(5'003, /*seed=*/2);
  ASSERT_TRUE(WritePhotonPly(Path("p.ply"), photons).ok());
  const std::size_t query_count = 1'000;
  const auto positions = MakePoints(query_count, /*seed=*/3);
  std::string csv = "x,y,z\n";
  for (std::size_t i = 0; i < query_count; ++i) {
    csv += fmt::format("{},{},{}\n", positions[3 * i], positions[3 * i + 1], positions[3 * i + 2]);
  }
  std::ofstream(Path("q.csv")) << csv;

  const Outcome built = Run("build --photons p.ply --name cloud --leaf-size 4");
  ASSERT_EQ(built.exit_code, 0) << built.err;
  EXPECT_THAT(
      built.out,
      AllOf(HasSubstr("cloud@1"), HasSubstr("5003 (positions, powers, directions)"),
            HasSubstr("at most 4 photons in a leaf"), HasSubstr("stage"), HasSubstr("tree")));

  const auto map = MakeBruteForceBuilder()->Build(photons, {});
  ASSERT_TRUE(map.ok());
  const std::uint32_t outputs = kOutputCount | kOutputRadius | kOutputNeighbors;
  for (const auto& [k, radius] : {std::pair{8u, 0.05f}, std::pair{0u, 0.07f}}) {
    const auto expected = (*map)->Gather({.positions = positions, .normals = {}, .radii = {}},
                                         {.k = k, .radius = radius, .outputs = outputs});
    ASSERT_TRUE(expected.ok());
    const Outcome gathered =
        Run(fmt::format("gather --map cloud --queries q.csv --k {} --radius {} --outputs "
                        "count,radius,neighbors --output a.csv",
                        k, radius));
    ASSERT_EQ(gathered.exit_code, 0) << gathered.err;
    EXPECT_THAT(gathered.err, HasSubstr("1000 queries on cloud@1"));
    EXPECT_EQ(ReadFile(Path("a.csv")),
              AnswerCsvHeader(outputs) +
                  AnswerCsvLines(*expected, outputs, k, query_count, /*first_query=*/0));
    EXPECT_FALSE(std::filesystem::exists(Path("a.csv.part")));
  }
}

TEST_F(TreelightWithServerTest, DensitiesAndStatisticsGoToStdout) {
  ASSERT_TRUE(WritePhotonPly(Path("p.ply"), MakePhotons(1'000, /*seed=*/4)).ok());
  std::ofstream(Path("q.csv")) << "0.5,0.5,0.5,0,0,1,0.4\n0.2,0.2,0.2,0,1,0,0.1\n";
  ASSERT_EQ(Run("build --photons p.ply --name cloud").exit_code, 0);
  const Outcome gathered =
      Run("gather --map cloud@1 --queries q.csv --k 50 --outputs density,statistics --kernel cone");
  ASSERT_EQ(gathered.exit_code, 0) << gathered.err;
  EXPECT_THAT(
      gathered.out,
      StartsWith("query,density_red,density_green,density_blue,nodes_visited,distance_tests\n0,"));
  EXPECT_EQ(std::count(gathered.out.begin(), gathered.out.end(), '\n'), 3);
}

TEST_F(TreelightWithServerTest, AttributesAreSentWhereAnOutputNeedsThem) {
  constexpr std::uint64_t kPhotons = 20'000;
  ASSERT_TRUE(WritePhotonPly(Path("p.ply"), MakePhotons(kPhotons, /*seed=*/8)).ok());
  struct Case {
    std::string name, arguments;
    bool powers, directions;
    std::uint64_t photon_bytes;
  };
  const std::vector<Case> cases = {
      {"all", "", true, true, 28},
      {"density", " --outputs count,radius,density", true, false, 24},
      {"normals", " --outputs density --normals", true, true, 28},
      {"lists", " --outputs count,radius,neighbors,statistics,error-bound", false, false, 12}};
  std::ofstream(Path("q.csv")) << "0.5,0.5,0.5\n";
  std::ofstream(Path("n.csv")) << "0.5,0.5,0.5,0,0,1\n";
  for (const Case& sent : cases) {
    const Outcome built = Run("build --photons p.ply --json --name " + sent.name + sent.arguments);
    ASSERT_EQ(built.exit_code, 0) << built.err;
    const auto map = nlohmann::json::parse(built.out)["map"];
    EXPECT_EQ(map.value("has_powers", false), sent.powers) << sent.name;
    EXPECT_EQ(map.value("has_directions", false), sent.directions) << sent.name;
    const std::string gather = "gather --k 50 --map " + sent.name;
    EXPECT_EQ(Run(gather + " --queries q.csv --outputs neighbors").exit_code, 0);
    EXPECT_EQ(Run(gather + " --queries q.csv --outputs density").exit_code, sent.powers ? 0 : 1);
    EXPECT_EQ(Run(gather + " --queries n.csv --outputs density").exit_code,
              sent.directions ? 0 : 1);
    const std::uint64_t bytes = LoggedBuildBytes(sent.name),
                        expected = kPhotons * sent.photon_bytes;
    EXPECT_GE(bytes, expected) << sent.name;
    EXPECT_LE(bytes, expected + 1'000) << sent.name;  // the header, and what frames the arrays
  }
}

TEST_F(TreelightWithServerTest, MapsAreListedShownAndDeleted) {
  ASSERT_TRUE(WritePhotonPly(Path("p.ply"), MakePhotons(100, /*seed=*/5)).ok());
  ASSERT_EQ(Run("build --photons p.ply --name cloud").exit_code, 0);
  const auto built =
      nlohmann::json::parse(Run("build --photons p.ply --name cloud --ttl 100 --json").out);
  EXPECT_EQ(built["map"]["version"], "2");
  const Outcome list = Run("maps list");
  EXPECT_EQ(list.exit_code, 0);
  EXPECT_EQ(std::count(list.out.begin(), list.out.end(), '\n'), 3) << list.out;
  EXPECT_EQ(nlohmann::json::parse(Run("maps list --json").out)["maps"].size(), 2u);
  EXPECT_THAT(Run("maps show cloud").out, HasSubstr("cloud@2"));
  EXPECT_EQ(nlohmann::json::parse(Run("maps show cloud@1 --json").out)["photon_count"], "100");
  EXPECT_EQ(Run("maps delete cloud@1").out, "deleted 1 version\n");
  EXPECT_THAT(FailingRun("maps show cloud@1", 1), HasSubstr("version 1"));
  EXPECT_EQ(nlohmann::json::parse(Run("info --json").out)["map_count"], 1);
}

TEST_F(TreelightWithServerTest, InfoAndDevicesDescribeTheServer) {
  EXPECT_THAT(Run("info").out, AllOf(HasSubstr("largest message"), HasSubstr("4.0 MiB")));
  const Outcome devices = Run("devices");
  EXPECT_EQ(devices.exit_code, 0) << devices.err;
  EXPECT_THAT(devices.out, HasSubstr("*"));  // the one in use
  const auto local = nlohmann::json::parse(Run("devices --local --json").out);
  const auto remote = nlohmann::json::parse(Run("devices --json").out);
  EXPECT_FALSE(remote["devices"].empty());
  EXPECT_EQ(local["devices"], remote["devices"]);  // the server is on this machine
}

TEST_F(TreelightWithServerTest, RefusalsAreOneLineAndExitCode1) {
  ASSERT_TRUE(WritePhotonPly(Path("p.ply"), MakePhotons(100, /*seed=*/6)).ok());
  ASSERT_TRUE(WritePhotonPly(Path("none.ply"), {}).ok());
  std::ofstream(Path("q.csv")) << "0,0,0\n";
  ASSERT_EQ(Run("build --photons p.ply --name cloud").exit_code, 0);
  EXPECT_THAT(FailingRun("gather --map fog --queries q.csv --k 1", 1), HasSubstr("fog"));
  EXPECT_THAT(FailingRun("gather --map cloud --queries q.csv --k 0", 2), HasSubstr("--radius"));
  EXPECT_THAT(FailingRun("build --photons none.ply --name cloud", 1), HasSubstr("photon_count"));
  EXPECT_EQ(nlohmann::json::parse(Run("info --json").out)["map_count"], 1);
}

TEST_F(TreelightWithServerTest, AFullStandardOutputIsOneLineAndExitCode1) {
  ASSERT_TRUE(WritePhotonPly(Path("p.ply"), MakePhotons(100, /*seed=*/7)).ok());
  std::ofstream(Path("q.csv")) << "0,0,0\n";
  ASSERT_EQ(Run("build --photons p.ply --name cloud").exit_code, 0);
  for (const char* command : {"gather --map cloud --queries q.csv", "info", "maps list --json"}) {
    const Outcome outcome = Run(command, "/dev/full");
    EXPECT_EQ(outcome.exit_code, 1) << command;
    EXPECT_EQ(outcome.err, "treelight: cannot write standard output: No space left on device\n");
  }
}

TEST_F(TreelightWithServerTest, TracedPhotonsBecomeAMapThatAnswers) {
  const Outcome traced = Run("trace --scene cornell --photons 3000 --seed 5 --output photons.ply");
  ASSERT_EQ(traced.exit_code, 0) << traced.err;
  const auto photons = ReadPhotonPly(Path("photons.ply"));
  ASSERT_TRUE(photons.ok()) << photons.status();
  EXPECT_GE(photons->size(), 3000u);
  EXPECT_EQ(photons->powers.size(), 3 * photons->size());
  EXPECT_EQ(photons->directions.size(), 2 * photons->size());
  EXPECT_THAT(traced.out,
              AllOf(StartsWith(fmt::format("photons: {} = ", photons->size())),
                    HasSubstr(" indirect + "), HasSubstr(" caustic\n"), HasSubstr("\nemitted ")));
  const Outcome built = Run("build --photons photons.ply --name room");
  ASSERT_EQ(built.exit_code, 0) << built.err;
  EXPECT_THAT(built.out,
              HasSubstr(fmt::format("{} (positions, powers, directions)", photons->size())));
  std::ofstream(Path("q.csv")) << "x,y,z,nx,ny,nz\n0.5,0,0.5,0,1,0\n";  // the middle of the floor
  const Outcome gathered = Run("gather --map room --queries q.csv --outputs count,density");
  ASSERT_EQ(gathered.exit_code, 0) << gathered.err;
  EXPECT_THAT(gathered.out, HasSubstr("\n0,50,"));  // as many as k allows unless told otherwise
}

TEST_F(TreelightWithServerTest, ARenderIsNearItsReference) {
  const Outcome reference =
      Run("render --reference --width 64 --height 64 --spp 256 --output reference.exr");
  ASSERT_EQ(reference.exit_code, 0) << reference.err;
  const Outcome render =
      Run("render --width 64 --height 64 --spp 16 --photons 20000 --compare reference.exr "
          "--output picture.png --output picture.exr");
  ASSERT_EQ(render.exit_code, 0) << render.err;
  EXPECT_TRUE(ReadFile(Path("picture.png")).starts_with("\x89PNG\r\n"));
  EXPECT_FALSE(std::filesystem::exists(Path("picture.png.part")));
  // Radii that are given win over those that the maps suggest.
  const Outcome fixed = Run(
      "render --width 8 --height 8 --spp 1 --photons 20000 --radius 0.0625 --caustic-radius 0.125 "
      "--output small.png");
  EXPECT_THAT(fixed.out, ::testing::ContainsRegex("largest radius, scene units +0.0625 +0.125\n"));
  EXPECT_THAT(render.out, Not(HasSubstr("0.0625")));
  EXPECT_THAT(render.out, AllOf(HasSubstr("picture: picture.png\npicture: picture.exr\n"),
                                HasSubstr("gathers/s of kernel time"),
                                HasSubstr("gathers/s of wall time"), HasSubstr("light: ")));
  EXPECT_THAT(Run("maps list --json").out, Not(HasSubstr("cornell")));  // deleted at the end
  const std::string mark = "against reference.exr: RMSE ";
  const std::size_t line = render.out.find(mark);
  ASSERT_NE(line, render.out.npos) << render.out;
  double rmse = 0, clipped_rmse = 0;
  ASSERT_EQ(std::sscanf(&render.out[line + mark.size()], "%lf (%lf", &rmse, &clipped_rmse), 2);
  // 0.031 to 0.033 for three seeds, of which the noise of the reference is 0.03; without caustics
  // it would be 0.055, without indirect light 0.068.
  EXPECT_LT(clipped_rmse, 0.045);
  EXPECT_LT(rmse, 0.2);  // 0.08 to 0.09: values above white at the rim of the lamp weigh most
}

TEST_F(TreelightWithServerTest, ARenderOfMergedPhotonsIsNearTheExactOne) {
  const std::string options =
      "render --width 64 --height 64 --spp 4 --photons 50000 --caustic-photons 0 --k 500 ";
  const Outcome exact = Run(options + "--output exact.exr");
  ASSERT_EQ(exact.exit_code, 0) << exact.err;
  EXPECT_THAT(exact.out, Not(HasSubstr("merged photons")));
  const Outcome merged =
      Run(options + "--max-relative-error 0.1 --compare exact.exr --output merged.png");
  ASSERT_EQ(merged.exit_code, 0) << merged.err;
  EXPECT_THAT(merged.out,
              ::testing::ContainsRegex(
                  "from merged photons, error measured of them +[1-9][0-9]*, off by 0"));
  const std::string mark = "relative MSE ";
  const std::size_t line = merged.out.find(mark);
  ASSERT_NE(line, merged.out.npos) << merged.out;
  // All of the rest is the same, so that errors are at most those of the densities.
  const double relative_mse = std::stod(merged.out.substr(line + mark.size()));
  EXPECT_LT(relative_mse, 0.01);
}

// The same room with a painted wall and with a mirror: a map of caustics is made where something
// focuses light, and nowhere else.
TEST_F(TreelightWithServerTest, ACausticMapIsMadeOnlyWhereSomethingIsSpecular) {
  std::ofstream(Path("room.json")) << R"({
    "new_materials": {"floor": {"reflectance": 0.5}, "wall": {"reflectance": 0.5}},
    "quads": [{"center": [0, 0, 0], "size": [4, 4], "material": "floor"},
              {"center": [0, 2, -2], "size": [4, 4], "normal": [0, 0, 1], "material": "wall"}],
    "lights": [{"type": "area", "center": [0, 4, 0], "direction": [0, -1, -0.5], "size": [1, 1],
                "radiance": [9, 9, 9]}],
    "cameras": [{"name": "front", "position": [0, 2, 5], "target": [0, 1, 0],
                 "vertical_fov_degrees": 60}]})";
  const auto render = [this](const std::string& name, const std::string& more) {
    const Outcome outcome =
        Run("render --scene room.json --width 8 --height 8 --spp 1 --photons 2000 --keep-map "
            "--output p.png --map-name " +
            name + more);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.out;
  };
  const std::string mirror = " --material wall:surface=mirror";
  EXPECT_THAT(render("painted", " --caustic-photons 400"), HasSubstr("caustic map: none, since "));
  EXPECT_THAT(render("mirror", " --caustic-photons 400" + mirror), Not(HasSubstr("none, since")));
  EXPECT_THAT(render("unwanted", " --caustic-photons 0" + mirror), Not(HasSubstr("none, since")));
  std::set<std::string> names;
  const auto maps = nlohmann::json::parse(Run("maps list --json").out);
  for (const auto& map : maps.at("maps")) names.insert(map.at("name"));
  EXPECT_THAT(names, ::testing::ElementsAre("mirror.caustic", "mirror.indirect", "painted.indirect",
                                            "unwanted.indirect"));
}

// Whoever reads the preview while it is rendered gets a whole picture, and the last one is the
// picture itself.
TEST_F(TreelightWithServerTest, APreviewIsValidAtAllTimes) {
  Outcome render;
  std::atomic<bool> ended = false;
  std::thread renderer([&] {
    render =
        Run("render --width 96 --height 96 --spp 64 --photons 2000 --final-gather 1 --output "
            "picture.png "
            "--preview preview.png --preview-every 0");
    ended = true;
  });
  std::set<std::string> seen;
  while (!ended) {
    const std::string bytes = ReadFile(Path("preview.png"));
    if (bytes.empty()) continue;  // not there yet
    int width = 0, height = 0, channels = 0;
    stbi_uc* const pixels =
        stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(bytes.data()),
                              static_cast<int>(bytes.size()), &width, &height, &channels, 0);
    EXPECT_NE(pixels, nullptr) << stbi_failure_reason();
    EXPECT_EQ(width, 96);
    stbi_image_free(pixels);
    seen.insert(bytes);
  }
  renderer.join();
  EXPECT_EQ(render.exit_code, 0) << render.err;
  EXPECT_GT(seen.size(), 2u);
  EXPECT_EQ(ReadFile(Path("preview.png")), ReadFile(Path("picture.png")));
  EXPECT_THAT(render.out, HasSubstr(" s, both at once for at least "));
}

TEST_F(TreelightWithServerTest, AServerThatDrainsStillGivesThePicture) {
  Outcome render;
  std::thread renderer([&] {
    render = Run("render --width 64 --height 64 --spp 512 --photons 2000 --output picture.png");
  });
  // Both streams are open when the second one has had an answer, which the log tells.
  const auto streams = [&] {
    std::istringstream log(ReadFile(Path("server.log")));
    for (std::string line; std::getline(log, line);) {
      if (line.find("GatherStream") != line.npos && line.find("cornell.caustic") != line.npos)
        return true;
    }
    return false;
  };
  for (int tries = 0; tries < 1000 && !streams(); ++tries) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_FALSE(std::filesystem::exists(Path("picture.png")));
  Stop();
  renderer.join();
  EXPECT_EQ(render.exit_code, 0) << render.err;
  EXPECT_THAT(render.err, HasSubstr("treelight: warning: the maps are not deleted: "));
  EXPECT_TRUE(ReadFile(Path("picture.png")).starts_with("\x89PNG\r\n"));
}

}  // namespace
}  // namespace treelight::client
