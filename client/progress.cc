#include "client/progress.h"

#include <unistd.h>

#include <algorithm>
#include <utility>

#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::chrono::milliseconds kTerminalInterval{100};
constexpr std::chrono::milliseconds kPlainInterval{2000};
constexpr int kBarWidth = 30;  // characters

std::string Bar(double share) {
  const int full = static_cast<int>(share * kBarWidth);
  return std::string(full, '#') + std::string(kBarWidth - full, '.');
}

}  // namespace

Progress::Progress(std::string label, std::uint64_t total, std::string unit, std::FILE* stream)
    : label_(std::move(label)),
      unit_(std::move(unit)),
      total_(total),
      stream_(stream),
      terminal_(isatty(fileno(stream)) == 1),
      shown_at_(std::chrono::steady_clock::now()) {}

Progress::~Progress() { End(); }

void Progress::End() {
  const std::lock_guard lock(mutex_);
  if (ended_) return;
  ended_ = true;
  if (!began_ && !terminal_) return;  // too short for a line
  if (!began_ || shown_ != done_) Show(done_);
  if (terminal_) fmt::print(stream_, "\n");
}

void Progress::Update(std::uint64_t done) {
  const std::lock_guard lock(mutex_);
  done_ = std::max(done_, std::min(done, total_));
  const auto now = std::chrono::steady_clock::now();
  if (now - shown_at_ < (terminal_ ? kTerminalInterval : kPlainInterval)) return;
  shown_at_ = now;
  Show(done_);
}

void Progress::Show(std::uint64_t done) {
  began_ = true;
  shown_ = done;
  const double share = total_ == 0 ? 1 : static_cast<double>(done) / static_cast<double>(total_);
  if (terminal_) {
    fmt::print(stream_, "\r{} [{}] {:3.0f} % {}/{} {}", label_, Bar(share), 100 * share, done,
               total_, unit_);
  } else {
    fmt::print(stream_, "{}: {:.0f} %, {} of {} {}\n", label_, 100 * share, done, total_, unit_);
  }
  std::fflush(stream_);
}

}  // namespace treelight::client
