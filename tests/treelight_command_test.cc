// Drives the program `treelight` as a user does, without a server.
#include "tests/treelight_command.h"

#include <fcntl.h>
#include <sys/stat.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <string>

#include "client/photon_ply.h"
#include "client/render/image_file.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/server_fixture.h"

namespace treelight::client {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using ::treelight::testing::MakePhotons;
using ::treelight::testing::Outcome;
using ::treelight::testing::ReadFile;

class TreelightCommandTest : public ::treelight::testing::TreelightCommand {};

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
  EXPECT_THAT(FailingRun("render --max-relative-error 1", 2), HasSubstr("--max-relative-error"));
  EXPECT_THAT(FailingRun("render --max-relative-error 0.1 --progressive", 2),
              HasSubstr("excludes --progressive"));
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

TEST_F(TreelightCommandTest, OutputsThatAFileCannotGiveAreRefused) {
  Photons photons = MakePhotons(10, /*seed=*/2);
  photons.directions.clear();
  ASSERT_TRUE(WritePhotonPly(Path("lit.ply"), photons).ok());
  photons.powers.clear();
  ASSERT_TRUE(WritePhotonPly(Path("bare.ply"), photons).ok());
  EXPECT_THAT(FailingRun("build --photons bare.ply --name n --outputs count,density", 1),
              HasSubstr("bare.ply: its photons have no powers, which density needs"));
  EXPECT_THAT(FailingRun("build --photons lit.ply --name n --outputs density --normals", 1),
              HasSubstr("lit.ply: its photons have no directions, which normals need"));
  EXPECT_THAT(FailingRun("build --photons lit.ply --name n --outputs count --normals", 2),
              HasSubstr("only density reads them"));
  EXPECT_THAT(FailingRun("build --photons lit.ply --name n --normals", 2), HasSubstr("--outputs"));
  EXPECT_THAT(FailingRun("build --photons lit.ply --name n --outputs light", 2),
              HasSubstr("light"));
}

TEST_F(TreelightCommandTest, BuildsPresentTheBuildersThatWinFirst) {
  for (const char* command : {"build", "rebuild"}) {
    const Outcome help = Run(std::string(command) + " --help");
    EXPECT_EQ(help.exit_code, 0) << help.err;
    std::istringstream text(help.out);
    std::string words;
    for (std::string word; text >> word;) words += word + " ";
    EXPECT_THAT(words, AllOf(HasSubstr("auto, lbvh, hybrid, isa (default"),
                             HasSubstr("For studies: treelet, trbvh, atrbvh, balanced, karras, "
                                       "sah, vvh; ")));
  }
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
                "or it is\nstopping; 130 load was interrupted"));
  EXPECT_THAT(Run("--version").out, StartsWith("treelight "));
}

}  // namespace
}  // namespace treelight::client
