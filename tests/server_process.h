#ifndef TREELIGHT_TESTS_SERVER_PROCESS_H_
#define TREELIGHT_TESTS_SERVER_PROCESS_H_

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "grpcpp/create_channel.h"
#include "grpcpp/security/credentials.h"
#include "tests/temporary_folder.h"
#include "treelight/v1/photon_map.grpc.pb.h"

// The program itself: TREELIGHTD is its path, or what the environment's TREELIGHT_TEST_SERVER names
// in its place.
namespace treelight::testing {

inline std::string ServerProgram() {
  const char* const other = std::getenv("TREELIGHT_TEST_SERVER");
  return other == nullptr ? TREELIGHTD : other;
}

/// A treelightd with its output in files of a folder of its own. Ended with SIGKILL where a test
/// has not.
class Process {
 public:
  explicit Process(std::vector<std::string> arguments)
      : Process(std::vector<std::string>{}, std::move(arguments)) {}

  /// Started by `launcher`, "unshare" and its arguments say.
  Process(std::vector<std::string> launcher, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), ServerProgram());
    arguments.insert(arguments.begin(), launcher.begin(), launcher.end());
    std::vector<char*> argv;
    for (auto& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    pid_ = fork();
    if (pid_ == 0) {
      dup2(open((folder_ + "/out").c_str(), O_CREAT | O_WRONLY, 0600), STDOUT_FILENO);
      dup2(open((folder_ + "/err").c_str(), O_CREAT | O_WRONLY, 0600), STDERR_FILENO);
      execvp(argv[0], argv.data());
      _exit(127);
    }
  }
  ~Process() {
    if (pid_ > 0) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  std::string out() const { return Read("out"); }
  std::string err() const { return Read("err"); }
  const std::string& folder() const { return folder_; }
  pid_t pid() const { return pid_; }
  void Signal(int signal) const { kill(pid_, signal); }

  /// Waits for the end; the exit code.
  int Wait() {
    int status = 0;
    waitpid(std::exchange(pid_, 0), &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  }

  /// Waits for the ready line, or the end; the address in it, else empty.
  std::string WaitUntilReadyOrEnded() {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(2);
    int status = 0;
    while (out().find('\n') == std::string::npos && std::chrono::steady_clock::now() < end) {
      if (waitpid(pid_, &status, WNOHANG) == pid_) {
        pid_ = 0;
        return {};
      }
      usleep(5'000);
    }
    return WaitUntilReady();
  }

  /// Waits for the ready line; the address in it. Kernels may have to be compiled first.
  std::string WaitUntilReady() const {
    const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(2);
    while (out().find('\n') == std::string::npos && std::chrono::steady_clock::now() < end) {
      usleep(5'000);
    }
    const std::string line = out(), before = " listening on ";
    const std::size_t first = line.find(before);
    if (first == std::string::npos) return {};
    return line.substr(first + before.size(), line.find(',', first) - first - before.size());
  }

 private:
  std::string Read(const std::string& name) const {
    std::ostringstream text;
    text << std::ifstream(folder_ + "/" + name).rdbuf();
    return text.str();
  }

  TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();
  pid_t pid_ = 0;
};

inline std::unique_ptr<v1::PhotonMapService::Stub> Connect(const std::string& address) {
  return v1::PhotonMapService::NewStub(
      grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
}

inline std::size_t Lines(const std::string& text) {
  return std::count(text.begin(), text.end(), '\n');
}

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_SERVER_PROCESS_H_
