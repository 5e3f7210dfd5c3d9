#include "server/request_log.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <thread>

#include "gtest/gtest.h"
#include "nlohmann/json.hpp"
#include "server/file_handle.h"

namespace treelight::server {
namespace {

using std::chrono::steady_clock;

RequestRecord Record() {
  RequestRecord record;
  record.method = "Gather";
  return record;
}

/// A named pipe that this process holds open and reads when it is told to.
class LogPipe : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(mkfifo(path_.c_str(), 0600), 0);
    pipe_ = FileHandle(open(path_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
    ASSERT_GE(pipe_.get(), 0);
    auto log = RequestLog::Open(path_);
    ASSERT_TRUE(log.ok()) << log.status();
    log_ = *std::move(log);
  }
  void TearDown() override {
    Read();
    unlink(path_.c_str());
  }

  void Write(int lines) {
    for (int i = 0; i < lines; ++i) log_->Write(Record(), absl::OkStatus());
  }

  /// Reads until nothing has come for half a second.
  void Read() {
    char bytes[65536];
    pollfd readable{pipe_.get(), POLLIN, 0};
    while (poll(&readable, 1, 500) > 0) {
      const ssize_t count = read(pipe_.get(), bytes, sizeof bytes);
      if (count > 0) text_.append(bytes, static_cast<std::size_t>(count));
    }
  }

  const std::string path_ = ::testing::TempDir() + "/log_pipe_" + std::to_string(getpid());
  FileHandle pipe_;
  std::unique_ptr<RequestLog> log_;
  std::string text_;
};

TEST_F(LogPipe, AReaderThatStandsStillHoldsNobodyUpAndWhatIsLostIsCounted) {
  constexpr int kLines = 20000;
  const auto begin = steady_clock::now();
  Write(kLines);
  EXPECT_LT(steady_clock::now() - begin, std::chrono::seconds(20));
  Read();
  Write(1);
  Read();
  std::uint64_t lost = 0, lines = 0;
  for (std::size_t at = 0; at < text_.size();) {
    const std::size_t end = text_.find('\n', at);
    ASSERT_NE(end, std::string::npos);
    const auto line = nlohmann::json::parse(text_.substr(at, end - at));
    if (line.contains("lines_lost")) {
      lost += line["lines_lost"].get<std::uint64_t>();
    } else {
      EXPECT_EQ(line["method"], "Gather");
      ++lines;
    }
    at = end + 1;
  }
  EXPECT_GT(lost, 0u);
  EXPECT_EQ(lost + lines, kLines + 1u);
}

TEST_F(LogPipe, AReaderThatStandsStillDoesNotHoldUpTheEnd) {
  Write(20000);
  const auto begin = steady_clock::now();
  log_.reset();
  EXPECT_LT(steady_clock::now() - begin, std::chrono::seconds(20));
}

TEST_F(LogPipe, TheEndWritesWhatIsLeft) {
  std::thread writer([&] {
    Write(500);
    log_.reset();
  });
  Read();
  writer.join();
  Read();
  EXPECT_EQ(std::count(text_.begin(), text_.end(), '\n'), 500);
}

TEST(RequestLogTest, ALineThatIsCutForWantOfRoomCostsNoOther) {
  constexpr std::uintmax_t kRoom = 40;
  const std::string path = ::testing::TempDir() + "/log_cut_" + std::to_string(getpid());
  auto log = RequestLog::Open(path);
  ASSERT_TRUE(log.ok()) << log.status();
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit full{.rlim_cur = kRoom, .rlim_max = before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &full);
  const FileHandle standard_error(dup(STDERR_FILENO));  // which has no room either
  dup2(FileHandle(open("/dev/full", O_WRONLY | O_CLOEXEC)).get(), STDERR_FILENO);
  (*log)->Write(Record(), absl::OkStatus());
  const auto end = steady_clock::now() + std::chrono::seconds(20);
  while (std::filesystem::file_size(path) < kRoom && steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  setrlimit(RLIMIT_FSIZE, &before);
  (*log)->Write(Record(), absl::OkStatus());
  log->reset();  // writes what is left
  dup2(standard_error.get(), STDERR_FILENO);
  std::ifstream lines(path);
  std::string line, last;
  while (std::getline(lines, line)) last = line;
  EXPECT_TRUE(nlohmann::json::accept(last)) << last;
  unlink(path.c_str());
}

}  // namespace
}  // namespace treelight::server
