// Drives the program `treelight` as a user does, most of it against a `treelightd` of its own.
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>
#include <set>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "client/answer_csv.h"
#include "client/photon_ply.h"
#include "client/query_file.h"
#include "client/render/image_file.h"
#include "core/builder.h"
#include "fmt/format.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "stb_image.h"
#include "tests/server_fixture.h"

namespace treelight::client {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;
using ::treelight::testing::MakePhotons;
using ::treelight::testing::MakePoints;

std::string ReadFile(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// How a run of `treelight` ended.
struct Outcome {
  int exit_code = -1;
  std::string out, err;
};

/// A folder of its own for each test, where `treelight` runs.
class TreelightCommandTest : public ::testing::Test {
 protected:
  TreelightCommandTest()
      : folder_(::testing::TempDir() + fmt::format("treelight_command_test.{}", getpid())) {
    std::filesystem::create_directories(folder_);
  }
  ~TreelightCommandTest() override { std::filesystem::remove_all(folder_); }

  std::string Path(const std::string& name) const { return folder_ + "/" + name; }

  /// `out` is where standard output goes, a file of the folder or a device.
  Outcome Run(const std::string& arguments, const std::string& out = "out") const {
    const std::string command =
        fmt::format("cd {} && TREELIGHT_SERVER={} {} {} >{} 2>err </dev/null", folder_,
                    server_address_, TREELIGHT_PROGRAM, arguments, out);
    const int status = std::system(command.c_str());
    return {.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1,
            .out = out == "out" ? ReadFile(Path(out)) : "",
            .err = ReadFile(Path("err"))};
  }

  /// Runs a command line that must fail with one line on stderr.
  std::string FailingRun(const std::string& arguments, int exit_code) const {
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, exit_code) << arguments << "\n" << outcome.err;
    EXPECT_THAT(outcome.err, StartsWith("treelight: ")) << arguments;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_THAT(outcome.out, IsEmpty()) << arguments;
    return outcome.err;
  }

  const std::string folder_;
  std::string server_address_ = "127.0.0.1:1";  // where nothing listens
};

TEST_F(TreelightCommandTest, AWrongCommandLineIsOneLineAndExitCode2) {
  EXPECT_THAT(FailingRun("", 2), HasSubstr("a subcommand is missing"));
  EXPECT_THAT(FailingRun("bogus", 2), HasSubstr("bogus"));
  EXPECT_THAT(FailingRun("info --bogus", 2), HasSubstr("--bogus"));
  EXPECT_THAT(FailingRun("info extra", 2), HasSubstr("extra"));
  EXPECT_THAT(FailingRun("maps", 2), HasSubstr("a subcommand is missing"));
  EXPECT_THAT(FailingRun("maps show", 2), HasSubstr("map is required"));
  EXPECT_THAT(FailingRun("maps show a@x", 2), HasSubstr("'a@x' is neither NAME nor NAME@VERSION"));
  EXPECT_THAT(FailingRun("--timeout never info", 2), HasSubstr("--timeout"));
  EXPECT_THAT(FailingRun("--timeout 0 info", 2), HasSubstr("--timeout"));
  EXPECT_THAT(FailingRun("build --photons p.ply", 2), HasSubstr("--name is required"));
  EXPECT_THAT(FailingRun("build --photons p.ply --name n --leaf-size 65", 2),
              HasSubstr("--leaf-size"));
  EXPECT_THAT(FailingRun("build --photons p.ply --name n --morton-bits 31", 2),
              HasSubstr("--morton-bits"));
  EXPECT_THAT(FailingRun("gather --map n", 2), HasSubstr("--queries is required"));
  EXPECT_THAT(FailingRun("gather --map n --queries q --k -1", 2), HasSubstr("--k"));
  EXPECT_THAT(FailingRun("gather --map n --queries q --k 4097", 2), HasSubstr("--k"));
  EXPECT_THAT(FailingRun("gather --map n --queries q --radius -1", 2), HasSubstr("--radius"));
  EXPECT_THAT(FailingRun("gather --map n --queries q --radius nan", 2), HasSubstr("--radius"));
  EXPECT_THAT(FailingRun("gather --map 'a b' --queries q", 2), HasSubstr("'a b' is no name"));
  EXPECT_THAT(FailingRun("build --photons p.ply --name 'a b'", 2), HasSubstr("'a b' is no name"));
  EXPECT_THAT(FailingRun("build --photons p.ply --name n --ttl nan", 2), HasSubstr("--ttl"));
  EXPECT_THAT(FailingRun("--server '' info", 2), HasSubstr("the address is empty"));
  EXPECT_THAT(FailingRun("--timeout nan info", 2), HasSubstr("--timeout"));
  EXPECT_THAT(FailingRun("render --exposure nan", 2), HasSubstr("--exposure"));
  EXPECT_THAT(FailingRun("render --radius nan", 2), HasSubstr("--radius"));
  EXPECT_THAT(FailingRun("render --seed -1", 2), HasSubstr("--seed"));
  for (const std::string command : {"render", "trace --output x.ply"}) {
    EXPECT_THAT(FailingRun(command + " --seed 18446744073709551616", 2),
                HasSubstr("--seed: '18446744073709551616' is more than 18446744073709551615"));
  }
  EXPECT_THAT(FailingRun("render --output a.png --output a.png", 2), HasSubstr("given twice"));
  EXPECT_THAT(FailingRun("render --kernel gauss", 2), HasSubstr("gauss"));
  EXPECT_THAT(FailingRun("render --caustic-kernel gauss", 2), HasSubstr("gauss"));
  EXPECT_THAT(FailingRun("render --final-gather -1", 2), HasSubstr("--final-gather"));
  EXPECT_THAT(FailingRun("render --noise 0.1", 2), HasSubstr("--noise requires --reference"));
  EXPECT_THAT(FailingRun("render --reference --final-gather 4", 2),
              AllOf(HasSubstr("--final-gather"), HasSubstr("--reference")));
  EXPECT_THAT(FailingRun("render --layers --output a.png", 2), HasSubstr("ends in .exr"));
  EXPECT_THAT(FailingRun("render --preview a.jpg", 2), HasSubstr("neither in .png nor in .exr"));
  EXPECT_THAT(FailingRun("render --preview a.png --output a.png", 2), HasSubstr("is an --output"));
  EXPECT_THAT(FailingRun("compare a.exr", 2), HasSubstr("reference is required"));
  EXPECT_THAT(FailingRun("compare a.exr b.exr --difference d.jpg", 2), HasSubstr("d.jpg"));
  EXPECT_THAT(FailingRun("compare a.exr b.exr --scale 0", 2), HasSubstr("--scale"));
  EXPECT_THAT(FailingRun("trace --seed -1 --output a.ply", 2), HasSubstr("--seed"));
  EXPECT_THAT(FailingRun("trace", 2), HasSubstr("--output is required"));
  EXPECT_THAT(FailingRun("gather --map n --queries q --outputs count,all", 2), HasSubstr("all"));
  EXPECT_THAT(FailingRun("gather --map n --queries q --kernel gauss", 2), HasSubstr("gauss"));
}

TEST_F(TreelightCommandTest, NoServerIsOneLineAndExitCode3) {
  ASSERT_TRUE(WritePhotonPly(Path("p.ply"), MakePhotons(10, /*seed=*/1)).ok());
  std::ofstream(Path("q.csv")) << "0,0,0\n";
  const auto began = std::chrono::steady_clock::now();
  for (const char* command :
       {"info", "devices", "maps list", "maps show n", "maps delete n",
        "build --photons p.ply --name n", "gather --map n --queries q.csv --k 1",
        "gather --map n --queries q.csv --k 1 --outputs neighbors"}) {
    EXPECT_THAT(FailingRun(command, 3), AllOf(HasSubstr("no server answers at 127.0.0.1:1"),
                                              HasSubstr("Connection refused")));
  }
  EXPECT_THAT(FailingRun("--server unix:/nowhere/treelight.sock info", 3),
              HasSubstr("unix:/nowhere/treelight.sock"));
  EXPECT_LT(std::chrono::steady_clock::now() - began, std::chrono::seconds(20));
}

/// `width` x 3 pixels, all of `color`.
void WriteExr(const std::string& path, int width, const Rgb& color) {
  Image image(width, 3);
  for (Rgb& pixel : image.pixels) pixel = color;
  ASSERT_TRUE(WriteImage(image, path, {.pixels = ExrPixels::kFloat}).ok());
}

TEST_F(TreelightCommandTest, TraceKeepsTheSetsApart) {
  const std::string options = "trace --photons 2000 --caustic-photons 700 --seed 6 --output ";
  ASSERT_EQ(Run(options + "both.ply").exit_code, 0);
  const Outcome apart = Run(options + "indirect.ply --caustic-output caustic.ply");
  ASSERT_EQ(apart.exit_code, 0) << apart.err;
  EXPECT_THAT(apart.out, AllOf(HasSubstr("caustic\nphotons"), HasSubstr("emitted "),
                               HasSubstr("+ escaped from the scene"), HasSubstr(" Mrays/s")));
  const auto both = ReadPhotonPly(Path("both.ply")), indirect = ReadPhotonPly(Path("indirect.ply")),
             caustic = ReadPhotonPly(Path("caustic.ply"));
  ASSERT_TRUE(both.ok() && indirect.ok() && caustic.ok());
  EXPECT_EQ(caustic->size(), 700u);
  EXPECT_EQ(both->size(), indirect->size() + caustic->size());
  std::vector<float> powers = indirect->powers;
  powers.insert(powers.end(), caustic->powers.begin(), caustic->powers.end());
  EXPECT_EQ(both->powers, powers);
  // In watts: each set holds what the table says of it, about 17 and 2.4 W.
  const auto sum = [](const Photons& photons) {
    return std::accumulate(photons.powers.begin(), photons.powers.end(), 0.0);
  };
  EXPECT_NEAR(sum(*indirect), 19, 2);
  EXPECT_NEAR(sum(*caustic), 2.4, 0.3);
}

TEST_F(TreelightCommandTest, TraceFollowsTheCamera) {
  const Outcome traced = Run(
      "trace --image-photons --photons 3000 --width 64 --height 48 --albedo 0.65 --output i.ply");
  ASSERT_EQ(traced.exit_code, 0) << traced.err;
  EXPECT_THAT(traced.out, AllOf(StartsWith("image photons: 3000, chosen from "),
                                HasSubstr(" of 3072 camera paths\n")));
  const auto photons = ReadPhotonPly(Path("i.ply"));
  ASSERT_TRUE(photons.ok()) << photons.status();
  EXPECT_EQ(photons->size(), 3000u);
  EXPECT_TRUE(photons->powers.empty());
  // All surfaces are diffuse then, the spheres too.
  bool on_sphere = false;
  for (std::size_t i = 0; i < photons->size(); ++i)
    on_sphere |=
        std::abs(SquaredDistance(photons->position(i), {-0.42f, 0.351f, -0.38f}) - 0.1225f) < 1e-4f;
  EXPECT_TRUE(on_sphere);
  EXPECT_THAT(FailingRun("trace --image-photons --photons 90000 --width 9 --output i.ply", 1),
              HasSubstr("90000 are to be chosen"));
  EXPECT_THAT(FailingRun("trace --width 9 --output i.ply", 2), HasSubstr("--image-photons"));
  EXPECT_THAT(FailingRun("trace --photons 0 --caustic-photons 0 --output i.ply", 2),
              HasSubstr("nothing to trace"));
  EXPECT_THAT(FailingRun("trace --output i.ply --caustic-output i.ply", 2),
              HasSubstr("i.ply is --output too"));
}

TEST_F(TreelightCommandTest, CompareTellsTheErrorAndShowsIt) {
  WriteExr(Path("a.exr"), 4, {0.5f, 0.25f, 0});
  WriteExr(Path("b.exr"), 4, {0.25f, 0.25f, 0.25f});
  const Outcome plain = Run("compare a.exr b.exr");
  EXPECT_EQ(plain.exit_code, 0) << plain.err;
  // Squares of 1/4, 0 and -1/4: RMSE sqrt(1/24); relative to 1/16 + 1/100: 0.57471.
  EXPECT_EQ(plain.out,
            "a.exr against b.exr: RMSE 0.2041 (0.2041 with radiances clipped at 1), relative MSE "
            "0.57471, mean +0.00 %\n");
  const Outcome exr = Run("compare a.exr b.exr --difference d.exr");
  EXPECT_EQ(exr.exit_code, 0) << exr.err;
  EXPECT_THAT(exr.out, HasSubstr("difference: d.exr, a.exr minus b.exr"));
  EXPECT_EQ(ReadExr(Path("d.exr"))->pixels[5], (Rgb{0.25f, 0, -0.25f}));
  WriteExr(Path("dark.exr"), 4, {0.15f, 0.15f, 0.15f});
  const Outcome png = Run("compare dark.exr b.exr --difference d.png");
  EXPECT_EQ(png.exit_code, 0) << png.err;
  EXPECT_THAT(png.out, HasSubstr("red: dark.exr is brighter, blue: darker; full colour at 0.1\n"));
  EXPECT_TRUE(ReadFile(Path("d.png")).starts_with("\x89PNG\r\n"));
}

TEST_F(TreelightCommandTest, CompareSaysWhatIsWrongWithAFile) {
  WriteExr(Path("a.exr"), 4, {1, 1, 1});
  WriteExr(Path("wide.exr"), 5, {1, 1, 1});
  WriteExr(Path("nan.exr"), 4, {1, NAN, 1});
  std::ofstream(Path("text.exr")) << "no picture";
  EXPECT_THAT(FailingRun("compare a.exr none.exr", 1), HasSubstr("there is no file none.exr"));
  EXPECT_THAT(FailingRun("compare text.exr a.exr", 1), HasSubstr("text.exr is no EXR"));
  EXPECT_THAT(FailingRun("compare a.exr wide.exr", 1),
              HasSubstr("a.exr is 4 x 3 pixels, wide.exr is 5 x 3"));
  EXPECT_THAT(FailingRun("compare a.exr nan.exr", 1),
              HasSubstr("nan.exr: pixel (0, 0) is (1, nan, 1)"));
  EXPECT_THAT(FailingRun("compare a.exr a.exr --difference none/d.png", 1),
              HasSubstr("cannot write none/d.png: No such file"));
}

TEST_F(TreelightCommandTest, AReferenceEndsAtItsNoiseAndHasLayers) {
  const Outcome outcome = Run(
      "render --reference --width 32 --height 32 --spp 4096 --noise 0.1 --layers --output r.exr "
      "--preview p.png");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  unsigned samples = 0;
  ASSERT_EQ(std::sscanf(outcome.out.c_str(), "path-traced with %u samples", &samples), 1);
  EXPECT_GE(samples, 16u);
  EXPECT_LT(samples, 4096u);
  const auto albedo = ReadExr(Path("r.exr"), kAlbedoChannels);
  ASSERT_TRUE(albedo.ok()) << albedo.status();
  EXPECT_NEAR(albedo->pixels[16 * 32 + 2].r, 0.63, 0.01);  // the red wall
  EXPECT_NEAR(ReadExr(Path("r.exr"), kNormalChannels)->pixels[16 * 32 + 2].r, 1, 0.01);
  EXPECT_TRUE(ReadFile(Path("p.png")).starts_with("\x89PNG\r\n"));
}

TEST_F(TreelightCommandTest, AReferenceThatLacksLightIsRefusedOrSaysSo) {
  const std::string command =
      "render --reference --width 8 --height 8 --spp 2 --output r.exr --light 0,1,0,1,1,1";
  EXPECT_THAT(FailingRun(command, 1),
              AllOf(HasSubstr("no reference of cornell: the light of the point light by way of "
                              "glass, mirror cannot be path-traced"),
                    HasSubstr("--allow-incomplete")));
  const Outcome allowed = Run(command + " --allow-incomplete");
  EXPECT_EQ(allowed.exit_code, 0) << allowed.err;
  EXPECT_THAT(allowed.err, HasSubstr("warning: the reference lacks the light of the point light"));
}

TEST_F(TreelightCommandTest, BadFilesAreOneLineAndExitCode1) {
  std::ofstream(Path("bad.ply")) << "ply\nformat ascii 1.0\nbogus\n";
  std::ofstream(Path("bad.csv")) << "1,2,3\n1,2,three\n";
  EXPECT_THAT(FailingRun("build --photons none.ply --name n", 1),
              HasSubstr("none.ply: No such file"));
  EXPECT_THAT(FailingRun("build --photons bad.ply --name n", 1), HasSubstr("bad.ply:3: "));
  EXPECT_THAT(FailingRun("gather --map n --queries bad.csv --k 1", 1),
              HasSubstr("bad.csv:2: column 3 is 'three'"));
  // Nobody writes to the pipe: opening it would wait for ever.
  ASSERT_EQ(mkfifo(Path("pipe").c_str(), 0600), 0);
  EXPECT_THAT(FailingRun("gather --map n --queries pipe --k 1", 1),
              HasSubstr("pipe: it is a pipe"));
  EXPECT_THAT(FailingRun("build --photons pipe --name n", 1), HasSubstr("pipe: it is a pipe"));
  EXPECT_THAT(FailingRun("compare pipe pipe", 1), HasSubstr("pipe: it is a pipe"));
  std::filesystem::create_symlink("pipe", Path("a.json"));
  EXPECT_THAT(FailingRun("trace --scene a.json --output a.ply", 1),
              HasSubstr("a.json: it is a pipe"));
  std::ofstream(Path("q.csv")) << "1,2,3\n";
  EXPECT_THAT(FailingRun("gather --map n --queries q.csv --k 1 --output none/a.csv", 1),
              HasSubstr("cannot write none/a.csv: No such file"));
  EXPECT_THAT(FailingRun("trace --output none/a.ply", 1),
              HasSubstr("cannot write none/a.ply: No such file"));
  // Before any work: nobody has asked the server, which does not answer.
  EXPECT_THAT(FailingRun("render --output a.png --output none/a.exr", 1),
              HasSubstr("cannot write none/a.exr: No such file"));
  EXPECT_FALSE(std::filesystem::exists(Path("a.png.part")));
}

TEST_F(TreelightCommandTest, AFullStandardOutputIsOneLineAndExitCode1) {
  for (const char* command : {"devices --local", "--help", "trace --photons 10 --output -"}) {
    const Outcome outcome = Run(command, "/dev/full");
    EXPECT_EQ(outcome.exit_code, 1) << command;
    EXPECT_EQ(outcome.err, "treelight: cannot write standard output: No space left on device\n");
  }
}

TEST_F(TreelightCommandTest, HelpTellsTheExitCodes) {
  const Outcome help = Run("--help");
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_THAT(
      help.out,
      HasSubstr("Exit codes: 0 done; 1 failed; 2 the command line is wrong; 3 no server answers, "
                "or it is\nstopping."));
  EXPECT_THAT(Run("--version").out, StartsWith("treelight "));
}

/// With a `treelightd` process on a free port.
class TreelightWithServerTest : public TreelightCommandTest {
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
            HasSubstr("at most 4 photons in a leaf"), HasSubstr("stage"), HasSubstr("morton")));

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
