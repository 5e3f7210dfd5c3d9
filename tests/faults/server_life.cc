#include "tests/faults/server_life.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

#include "fmt/format.h"
#include "tests/http_get.h"

namespace treelight::faults {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

std::string ReadFile(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

/// The number that ends at the first `end` after `before`; 0 where there is none.
int NumberAfter(const std::string& text, const std::string& before) {
  const std::size_t found = text.find(before);
  return found == text.npos ? 0 : std::atoi(text.c_str() + found + before.size());
}

/// Value of a metric, of all its labels together but those of holder "maps".
double MetricValue(const std::string& metrics, const std::string& name) {
  double sum = 0;
  std::istringstream lines(metrics);
  for (std::string line; std::getline(lines, line);) {
    const bool here = line.starts_with(name + " ") || line.starts_with(name + "{");
    if (here && line.find("\"maps\"") == line.npos) sum += std::atof(&line[line.rfind(' ')]);
  }
  return sum;
}

}  // namespace

ServerLife::ServerLife(Recorder& recorder, const std::vector<std::string>& arguments,
                       const std::string& folder)
    : recorder_(recorder), folder_(folder) {
  life_.start = recorder_.Now();
  const std::string out = folder_ + "/out", err = folder_ + "/err";
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  constexpr int kFlags = O_CREAT | O_TRUNC | O_WRONLY;
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, out.c_str(), kFlags, 0600);
  posix_spawn_file_actions_addopen(&files, STDERR_FILENO, err.c_str(), kFlags, 0600);
  std::vector<std::string> copies = arguments;
  std::vector<char*> argv;
  for (auto& argument : copies) argv.push_back(argument.data());
  argv.push_back(nullptr);
  if (posix_spawn(&pid_, argv[0], &files, nullptr, argv.data(), environ) != 0) pid_ = -1;
  posix_spawn_file_actions_destroy(&files);
  const auto patience = std::chrono::steady_clock::now() + 120s;
  while (pid_ > 0 && std::chrono::steady_clock::now() < patience) {
    const std::string told = ReadFile(out);
    metrics_port_ = NumberAfter(told, "metrics at http://127.0.0.1:");
    if (metrics_port_ != 0 && told.ends_with('\n')) {
      port_ = NumberAfter(told, "listening on 127.0.0.1:");
      life_.ready = recorder_.Now();
      return;
    }
    if (Reap(WNOHANG)) return;
    std::this_thread::sleep_for(2ms);
  }
  End(SIGKILL);
}

ServerLife::~ServerLife() { End(SIGKILL); }

bool ServerLife::Reap(int options) {
  int status = 0;
  if (pid_ <= 0 || waitpid(pid_, &status, options) != pid_) return false;
  pid_ = -1;
  life_.end = recorder_.Now();
  if (WIFEXITED(status)) life_.exit_code = WEXITSTATUS(status);
  if (WIFSIGNALED(status)) life_.ended_by = WTERMSIG(status);
  constexpr std::size_t kLastBytes = 600;
  life_.told = ReadFile(folder_ + "/err");
  life_.told.erase(0, life_.told.size() - std::min(life_.told.size(), kLastBytes));
  recorder_.Add(life_);
  return true;
}

bool ServerLife::Ended() { return pid_ <= 0 || Reap(WNOHANG); }

void ServerLife::End(int signal) {
  if (Ended()) return;
  life_.end_asked = recorder_.Now();
  life_.signal = signal;
  kill(pid_, signal);
  if (signal != SIGKILL) {
    const auto patience = std::chrono::steady_clock::now() + 30s;
    while (std::chrono::steady_clock::now() < patience) {
      if (Reap(WNOHANG)) return;
      std::this_thread::sleep_for(2ms);
    }
    kill(pid_, SIGKILL);  // which the checker sees
  }
  Reap(0);
}

std::optional<Quiet> ServerLife::Measure() const {
  const std::string metrics = testing::HttpGet(metrics_port_, "/metrics");
  if (metrics.find("treelight_open_calls ") == metrics.npos) return std::nullopt;
  Quiet quiet{.at = recorder_.Now(),
              .open_calls = MetricValue(metrics, "treelight_open_calls"),
              .open_builds = MetricValue(metrics, "treelight_open_builds"),
              .queue_depth = MetricValue(metrics, "treelight_device_queue_depth"),
              .held_bytes = MetricValue(metrics, "treelight_memory_held_bytes"),
              .resident_bytes = 0};
  std::istringstream pages(ReadFile(fmt::format("/proc/{}/statm", pid_)));
  double size = 0, resident = 0;
  pages >> size >> resident;
  quiet.resident_bytes = resident * static_cast<double>(sysconf(_SC_PAGESIZE));
  return quiet;
}

}  // namespace treelight::faults
