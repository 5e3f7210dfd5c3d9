#ifndef TREELIGHT_TESTS_TREELIGHT_COMMAND_H_
#define TREELIGHT_TESTS_TREELIGHT_COMMAND_H_

#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "fmt/format.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace treelight::testing {

/// All bytes of a file; empty where there is none.
inline std::string ReadFile(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// How a run of `treelight` ended.
struct Outcome {
  int exit_code = -1;
  std::string out, err;
};

/// A folder of its own for each test, where `treelight` runs.
class TreelightCommand : public ::testing::Test {
 protected:
  TreelightCommand()
      : folder_(::testing::TempDir() + fmt::format("treelight_command.{}", getpid())) {
    std::filesystem::create_directories(folder_);
  }
  ~TreelightCommand() override { std::filesystem::remove_all(folder_); }

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

  /// Starts `treelight` in the folder, its output in `out` and `err`.
  pid_t Start(const std::string& arguments) const {
    const pid_t pid = fork();
    if (pid == 0) {
      const std::string command =
          fmt::format("cd {} && TREELIGHT_SERVER={} exec {} {} >out 2>err </dev/null", folder_,
                      server_address_, TREELIGHT_PROGRAM, arguments);
      execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
      _exit(127);
    }
    return pid;
  }

  /// Waits for the end of one that was started.
  Outcome End(pid_t pid) const {
    int status = 0;
    waitpid(pid, &status, 0);
    return {.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1,
            .out = ReadFile(Path("out")),
            .err = ReadFile(Path("err"))};
  }

  /// Runs a command line that must fail with one line on stderr.
  std::string FailingRun(const std::string& arguments, int exit_code) const {
    const Outcome outcome = Run(arguments);
    EXPECT_EQ(outcome.exit_code, exit_code) << arguments << "\n" << outcome.err;
    EXPECT_THAT(outcome.err, ::testing::StartsWith("treelight: ")) << arguments;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_THAT(outcome.out, ::testing::IsEmpty()) << arguments;
    return outcome.err;
  }

  const std::string folder_;
  std::string server_address_ = "127.0.0.1:1";  // where nothing listens
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_TREELIGHT_COMMAND_H_
