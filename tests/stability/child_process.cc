#include "tests/stability/child_process.h"

#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <exception>
#include <new>
#include <system_error>

#include "fmt/format.h"

namespace treelight {
namespace {

using Clock = std::chrono::steady_clock;

// The first byte of what a child sends.
constexpr char kAnswer = 'a', kException = 'e', kNoMemory = 'm';

void Send(int pipe, char kind, const std::string& text) {
  const std::string message = kind + text;
  for (std::size_t sent = 0; sent < message.size();) {
    const ssize_t written = write(pipe, message.data() + sent, message.size() - sent);
    if (written <= 0) return;
    sent += static_cast<std::size_t>(written);
  }
}

[[noreturn]] void RunChild(int pipe, const ChildLimits& limits,
                           const std::function<std::string()>& work) {
  const rlimit memory{limits.bytes, limits.bytes}, no_core{0, 0};
  setrlimit(RLIMIT_AS, &memory);
  setrlimit(RLIMIT_CORE, &no_core);
  try {
    Send(pipe, kAnswer, work());
  } catch (const std::bad_alloc&) {
    Send(pipe, kNoMemory, "");
  } catch (const std::exception& error) {
    Send(pipe, kException, error.what());
  }
  _exit(0);  // no destructors of the parent's objects
}

/// What the child sends until it closes the pipe or `end` is there; whether it closed it.
bool ReadUntil(int pipe, Clock::time_point end, std::string& text) {
  for (;;) {
    const auto left =
        std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
    if (left <= 0) return false;
    pollfd wanted{.fd = pipe, .events = POLLIN, .revents = 0};
    if (poll(&wanted, 1, static_cast<int>(left)) <= 0) continue;
    char buffer[4096];
    const ssize_t got = read(pipe, buffer, sizeof buffer);
    if (got <= 0) return true;
    text.append(buffer, static_cast<std::size_t>(got));
  }
}

}  // namespace

ChildEnd RunInChild(const ChildLimits& limits, const std::function<std::string()>& work) {
  int pipes[2];
  if (pipe(pipes) != 0) throw std::system_error(errno, std::generic_category(), "pipe");
  const pid_t child = fork();
  if (child < 0) throw std::system_error(errno, std::generic_category(), "fork");
  if (child == 0) {
    close(pipes[0]);
    RunChild(pipes[1], limits, work);
  }
  close(pipes[1]);
  std::string message;
  const bool ended =
      ReadUntil(pipes[0], Clock::now() + std::chrono::seconds(limits.seconds), message);
  if (!ended) kill(child, SIGKILL);
  close(pipes[0]);
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!ended) return {.kind = ChildEnd::kTimedOut};
  if (WIFSIGNALED(status)) {
    return {.kind = ChildEnd::kKilledBySignal, .signal = WTERMSIG(status)};
  }
  const char kind = message.empty() ? kException : message[0];
  const std::string text = message.empty() ? "the process ended by itself" : message.substr(1);
  switch (kind) {
    case kAnswer:
      return {.kind = ChildEnd::kReturned, .answer = text};
    case kNoMemory:
      return {.kind = ChildEnd::kOutOfMemory};
    default:
      return {.kind = ChildEnd::kThrew, .answer = text};
  }
}

std::string Describe(const ChildEnd& end, const ChildLimits& limits) {
  switch (end.kind) {
    case ChildEnd::kReturned:
      return {};
    case ChildEnd::kThrew:
      return fmt::format("exception: {}", end.answer);
    case ChildEnd::kOutOfMemory:
      return fmt::format("out of memory ({:.3g} GiB)",
                         static_cast<double>(limits.bytes) / (1ull << 30));
    case ChildEnd::kKilledBySignal:
      return fmt::format("crash (SIG{})", sigabbrev_np(end.signal));
    case ChildEnd::kTimedOut:
      return fmt::format("does not end ({} s)", limits.seconds);
  }
  return "unknown";
}

std::uint64_t PeakResidentBytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

}  // namespace treelight
