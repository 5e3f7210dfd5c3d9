#include "client/chart_script.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>

#include "client/chart_style_script.h"
#include "client/output_file.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

/// The interpreter that Debian's packages are installed for, else the one that is found.
std::string FindPython() {
  constexpr const char* kSystemPython = "/usr/bin/python3";
  return access(kSystemPython, X_OK) == 0 ? kSystemPython : "python3";
}

/// Runs `words`; what it writes to stderr goes to `error`. Returns its exit code, or -1.
int RunProgram(const std::vector<std::string>& words, std::string& error) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  int ends[2];
  if (pipe(ends) != 0) return -1;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDERR_FILENO);
  posix_spawn_file_actions_addclose(&actions, ends[0]);
  pid_t child = -1;
  const int failed =
      posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  char buffer[4096];
  for (ssize_t count; failed == 0 && (count = read(ends[0], buffer, sizeof buffer)) > 0;)
    error.append(buffer, static_cast<std::size_t>(count));
  close(ends[0]);
  int status = 0;
  if (failed != 0 || waitpid(child, &status, 0) != child) return -1;
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/// The last line that is not empty: of a Python traceback what went wrong.
std::string LastLine(const std::string& text) {
  const std::size_t end = text.find_last_not_of("\n ");
  if (end == std::string::npos) return {};
  const std::size_t begin = text.rfind('\n', end);
  return text.substr(begin == std::string::npos ? 0 : begin + 1, end - begin);
}

absl::Status WriteScript(const std::string& path, std::string_view script) {
  auto file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  if (auto status = file->Write(script); !status.ok()) return status;
  return file->Commit();
}

}  // namespace

absl::Status RunChartScript(std::string_view script, const std::vector<std::string>& csv_paths,
                            const std::string& folder) {
  const std::filesystem::path parent = folder;
  const std::string path = (parent / "charts.py").string();
  if (auto status = WriteScript((parent / "chart_style.py").string(), kChartStyle); !status.ok())
    return status;
  if (auto status = WriteScript(path, script); !status.ok()) return status;
  std::vector<std::string> words = {FindPython(), "-B", path, folder};
  words.insert(words.end(), csv_paths.begin(), csv_paths.end());
  std::string error;
  const int exit_code = RunProgram(words, error);
  if (exit_code == 0) return absl::OkStatus();
  if (exit_code < 0 || exit_code == 127) {
    return absl::FailedPreconditionError(
        "no charts: Python is missing: apt install python3-matplotlib; the numbers are written");
  }
  const std::string what = LastLine(error);
  const bool wrong_numbers =
      std::ranges::any_of(csv_paths, [&](const std::string& csv) { return what.starts_with(csv); });
  return absl::FailedPreconditionError(
      fmt::format("no charts: {}{}", what, wrong_numbers ? "" : "; the numbers are written"));
}

}  // namespace treelight::client
