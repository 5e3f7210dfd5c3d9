// treelight_faults: a real treelightd under clients, kills and faults; what it answered is checked
// against brute force.
//
// Exit codes: 0 all that was promised was kept; 1 it was not; 2 wrong command line.

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>

#include "CLI/CLI.hpp"
#include "fmt/format.h"
#include "tests/faults/run.h"

namespace treelight::faults {
namespace {

constexpr std::uint64_t kDiskBytes = 24 << 20;

int Main(int argc, const char* const* argv) {
  RunOptions options{.server = {}, .seed = std::random_device{}()};
  std::int64_t seconds = options.length.count();
  CLI::App app("treelight_faults - what treelightd promises, while it is killed and cut off");
  app.add_option("--server", options.server, "Path of treelightd")->required();
  app.add_option("--seconds", seconds, "How long")
      ->capture_default_str()
      ->check(CLI::Range(1, 86'400));
  app.add_option("--seed", options.seed, "Of all that is drawn; else a fresh one");
  std::string history_file;
  app.add_option("--history", history_file, "File for what happened, a line an event");
  CLI11_PARSE(app, argc, argv);
  options.length = std::chrono::seconds(seconds);

  std::string folder = std::filesystem::temp_directory_path() / "treelight_faults_XXXXXX";
  if (mkdtemp(folder.data()) == nullptr) {
    fmt::print(stderr, "treelight_faults: no folder can be made in {}\n", folder);
    return 1;
  }
  RunReport report;
  {
    Disk disk(folder + "/maps", kDiskBytes);
    fmt::print("seed {}{}\n", options.seed,
               disk.small() ? "" : "; no file system can be mounted here: the disk is never full");
    std::fflush(stdout);
    report = Run(options, disk, folder);
  }
  std::filesystem::remove_all(folder);
  if (!history_file.empty()) std::ofstream(history_file) << report.history;
  fmt::print("{}\n", report.summary);
  constexpr std::size_t kShown = 20;
  for (std::size_t i = 0; i < report.violations.size() && i < kShown; ++i) {
    fmt::print("NOT KEPT, {}: {}\n", report.violations[i].rule, report.violations[i].text);
  }
  if (report.violations.empty()) {
    fmt::print("nothing was lost\n");
    return 0;
  }
  fmt::print("{} promises not kept; again with --seed {}\n", report.violations.size(),
             options.seed);
  return 1;
}

}  // namespace
}  // namespace treelight::faults

int main(int argc, char** argv) { return treelight::faults::Main(argc, argv); }
