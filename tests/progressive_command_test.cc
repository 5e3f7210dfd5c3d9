// `treelight render --progressive` against a `treelightd` process, as users run them: its ends.
#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "client/photon_map_client.h"
#include "fmt/format.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "stb_image.h"
#include "tests/server_process.h"
#include "tests/treelight_command.h"

namespace treelight::client {
namespace {

using ::testing::AllOf;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;
using ::treelight::testing::Outcome;
using ::treelight::testing::Process;
using ::treelight::testing::ReadFile;

constexpr char kSmall[] =
    "render --progressive --width 48 --height 48 --photons 2000 --caustic-photons 400 ";

class ProgressiveCommandTest : public ::treelight::testing::TreelightCommand {
 protected:
  void SetUp() override {
    server_address_ = server_.WaitUntilReady();
    ASSERT_THAT(server_address_, Not(IsEmpty())) << server_.err();
  }

  /// Waits until at least `passes` are in the curve that is being written.
  void WaitForPasses(std::size_t passes) const {
    for (int tries = 0; tries < 3000; ++tries) {
      // What is buffered comes a few lines at a time.
      if (::treelight::testing::Lines(ReadFile(Path("curve/progressive.csv.part"))) > passes)
        return;
      usleep(10'000);
    }
    FAIL() << "no passes: " << ReadFile(Path("err"));
  }

  static void ExpectPicture(const std::string& bytes, int side) {
    int width = 0, height = 0, channels = 0;
    stbi_uc* const pixels =
        stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(bytes.data()),
                              static_cast<int>(bytes.size()), &width, &height, &channels, 3);
    ASSERT_NE(pixels, nullptr) << stbi_failure_reason();
    EXPECT_EQ(width, side);
    const auto count = std::size_t(width) * height * 3;
    EXPECT_GT(std::count_if(pixels, pixels + count, [](stbi_uc p) { return p > 20; }),
              static_cast<std::ptrdiff_t>(count / 2));
    stbi_image_free(pixels);
  }

  std::size_t MapsLeft() const {
    PhotonMapClient client(server_address_);
    const auto maps = client.ListPhotonMaps();
    EXPECT_TRUE(maps.ok()) << maps.status();
    return maps->size();
  }

  Process server_{std::vector<std::string>{"--listen", "127.0.0.1:0"}};
};

TEST_F(ProgressiveCommandTest, PassesGoOnAsThePowerSaysAndTheCurveTellsIt) {
  ASSERT_EQ(Run("render --reference --width 48 --height 48 --spp 512 --output r.exr").exit_code, 0);
  const Outcome outcome = Run(std::string(kSmall) +
                              "--passes 12 --output p.png --compare r.exr --error-curve curve "
                              "--preview v.png");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("\n12 passes in "), HasSubstr(": all passes are done\n"),
                                 HasSubstr("\nestimated error: 0."), HasSubstr("against r.exr")));
  ExpectPicture(ReadFile(Path("p.png")), 48);
  EXPECT_EQ(ReadFile(Path("v.png")), ReadFile(Path("p.png")));
  EXPECT_EQ(MapsLeft(), 0u);

  std::istringstream csv(ReadFile(Path("curve/progressive.csv")));
  std::string line;
  std::getline(csv, line);
  EXPECT_THAT(line, StartsWith("passes,seconds,photons,radius,"));
  std::vector<double> estimated, measured;
  while (std::getline(csv, line)) {
    std::vector<std::string> cells;
    std::istringstream row(line);
    for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
    ASSERT_EQ(cells.size(), 14u) << line;
    EXPECT_EQ(cells[0], std::to_string(measured.size() + 1));
    measured.push_back(std::stod(cells[10]));
    if (measured.size() > 1) estimated.push_back(std::stod(cells[7]));
  }
  ASSERT_EQ(measured.size(), 12u);
  EXPECT_LT(measured[11], 0.5 * measured[0]);
  EXPECT_LT(estimated.back(), 0.5 * estimated.front());
  // The reference's own noise is in what is measured; edges are not in what is estimated.
  EXPECT_GT(estimated.back(), 0.2 * measured[11]);
  EXPECT_LT(estimated.back(), 1.5 * measured[11]);
}

TEST_F(ProgressiveCommandTest, EndsByErrorAndByTime) {
  const Outcome by_error = Run(std::string(kSmall) + "--target-error 0.2 --output p.png");
  ASSERT_EQ(by_error.exit_code, 0) << by_error.err;
  EXPECT_THAT(by_error.out, HasSubstr(": the target error is reached\n"));
  const Outcome by_time =
      Run(std::string(kSmall) + "--target-error 1e-6 --time-limit 0.5 --output p.png");
  ASSERT_EQ(by_time.exit_code, 0) << by_time.err;
  EXPECT_THAT(by_time.out, HasSubstr(": the time is up\n"));
  ExpectPicture(ReadFile(Path("p.png")), 48);
  EXPECT_EQ(MapsLeft(), 0u);
}

TEST_F(ProgressiveCommandTest, APilotPlansPassesForTheError) {
  const Outcome outcome =
      Run("render --photons auto --target-error 0.1 --width 48 --height 48 --output p.png");
  ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_THAT(
      outcome.out,
      AllOf(ContainsRegex("pilot: [0-9]+ photons"), HasSubstr("plan: "), HasSubstr(" of 0.1 in "),
            HasSubstr(": the target error is reached\n"), HasSubstr("estimated error: 0.0")));
  ExpectPicture(ReadFile(Path("p.png")), 48);
  EXPECT_EQ(MapsLeft(), 0u);
  const Outcome given =
      Run("render --photons auto --target-error 0.2 --k 77 --spp 3 --caustic-photons 0 --passes 2 "
          "--width 16 --height 16 --output p.png");
  ASSERT_EQ(given.exit_code, 0) << given.err;
  EXPECT_THAT(given.out,
              AllOf(ContainsRegex("pilot: [0-9]+ photons"), HasSubstr("k 77 and 3 samples a pixel"),
                    HasSubstr("2 passes in"), HasSubstr("of caustics none")));
}

TEST_F(ProgressiveCommandTest, AnInterruptLeavesThePictureAndNoMaps) {
  for (const int signal : {SIGINT, SIGTERM}) {
    const pid_t pid = Start(std::string(kSmall) +
                            "--passes 1000000 --output p.png --error-curve curve "
                            "--preview v.png --preview-every 0");
    WaitForPasses(3);
    bool has_maps = false;  // between passes there are none
    for (int tries = 0; !has_maps && tries < 10'000; ++tries) has_maps = MapsLeft() > 0;
    EXPECT_TRUE(has_maps);
    kill(pid, signal);
    const Outcome outcome = End(pid);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    EXPECT_THAT(outcome.out, HasSubstr(": interrupted\n"));
    ExpectPicture(ReadFile(Path("p.png")), 48);
    EXPECT_EQ(ReadFile(Path("v.png")), ReadFile(Path("p.png")));
    EXPECT_THAT(ReadFile(Path("curve/progressive.csv")), StartsWith("passes,"));
    EXPECT_EQ(MapsLeft(), 0u);
    std::filesystem::remove(Path("p.png"));
  }
}

TEST_F(ProgressiveCommandTest, AServerThatGoesIsOneLineExitCode3AndAPreview) {
  const pid_t pid = Start(std::string(kSmall) +
                          "--time-limit 600 --output p.png --error-curve curve --preview v.png "
                          "--preview-every 1000");
  WaitForPasses(3);
  server_.Signal(SIGKILL);
  const Outcome outcome = End(pid);
  EXPECT_EQ(outcome.exit_code, 3) << outcome.out;
  EXPECT_THAT(outcome.err, AllOf(StartsWith("treelight: no server answers at "),
                                 HasSubstr(" passes, which v.png shows)\n")));
  EXPECT_EQ(::treelight::testing::Lines(outcome.err), 1u) << outcome.err;
  EXPECT_THAT(outcome.out, IsEmpty());
  EXPECT_FALSE(std::filesystem::exists(Path("p.png")));
  EXPECT_FALSE(std::filesystem::exists(Path("p.png.part")));
  ExpectPicture(ReadFile(Path("v.png")), 48);
  EXPECT_THAT(ReadFile(Path("curve/progressive.csv")), StartsWith("passes,"));
}

TEST_F(ProgressiveCommandTest, OptionsThatDoNotGoTogetherAreRefused) {
  struct Refused {
    const char *options, *named;
  };
  for (const auto& [options, named] : std::vector<Refused>{
           {"--passes 3", "--passes: requires --progressive or --photons auto"},
           {"--target-error 0.1", "--target-error: requires --progressive or --photons auto"},
           {"--time-limit 1", "--time-limit: requires --progressive or --photons auto"},
           {"--error-curve curve", "--error-curve: requires --progressive or --photons auto"},
           {"--progressive --reference", "--reference"},
           {"--progressive --keep-map", "--keep-map"},
           {"--progressive --k 5", "--k"},
           {"--progressive --passes 0", "--passes"},
           {"--progressive --target-error nan", "--target-error"},
           {"--photons auto --reference", "--reference"},
           {"--photons auto --keep-map", "--keep-map"},
           {"--photons auto --radius 0.1", "--radius: is chosen by --photons auto"},
           {"--photons auto --caustic-radius 0.1", "--caustic-radius: is chosen by --photons auto"},
           {"--photons auto --k 0", "--k: is 0"},
           {"--photons auto --k 9", "--k: 9 is under 24"},
           {"--photons automatic", "automatic is neither a count nor auto"},
           {"--photons 2000000000", "--photons"}}) {
    EXPECT_THAT(FailingRun(std::string("render ") + options, 2), HasSubstr(named)) << options;
  }
  EXPECT_THAT(FailingRun("render --progressive --error-curve /dev/null/x", 1),
              HasSubstr("/dev/null"));
}

}  // namespace
}  // namespace treelight::client
