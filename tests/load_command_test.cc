// `treelight load` against a `treelightd` process: its table, CSV and charts.
#include <signal.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "tests/gated_builder.h"
#include "tests/server_process.h"
#include "tests/treelight_command.h"

namespace treelight::testing {
namespace {

using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

/// A row of a CSV by the names of its columns.
using Row = std::map<std::string, std::string>;

std::vector<std::string> Cells(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream stream(line + ",");
  for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
  return cells;
}

std::vector<Row> ReadCsv(const std::string& path) {
  std::istringstream lines(ReadFile(path));
  std::string line;
  std::getline(lines, line);
  const auto head = Cells(line);
  std::vector<Row> rows;
  while (std::getline(lines, line)) {
    const auto cells = Cells(line);
    EXPECT_EQ(cells.size(), head.size()) << line;
    Row& row = rows.emplace_back();
    for (std::size_t i = 0; i < std::min(head.size(), cells.size()); ++i) row[head[i]] = cells[i];
  }
  return rows;
}

class LoadCommandTest : public TreelightCommand {
 protected:
  void Serve() {
    server_ = std::make_unique<Process>(
        std::vector<std::string>{"--listen", "127.0.0.1:0", "--log-file", Path("log")});
    server_address_ = server_->WaitUntilReady();
    ASSERT_FALSE(server_address_.empty()) << server_->err();
  }
  /// Gathers that the server has logged.
  std::size_t Gathers() const {
    const std::string log = ReadFile(Path("log"));
    std::size_t count = 0;
    for (std::size_t at = 0; (at = log.find("\"Gather\"", at)) != log.npos; ++at) ++count;
    return count;
  }
  std::unique_ptr<Process> server_;
};

TEST_F(LoadCommandTest, ASweepOffersSharesOfWhatTheClosedLoopReached) {
  Serve();
  const Outcome load =
      Run("load --sweep 0.1,0.3 --duration 0.5 --photons 2000 --queries 20 --builds 0.1 "
          "--build-photons 200 --output sweep --csv other.csv");
  ASSERT_EQ(load.exit_code, 0) << load.err;
  EXPECT_THAT(load.out, StartsWith("kind"));
  const auto rows = ReadCsv(Path("sweep/load.csv"));
  EXPECT_EQ(ReadFile(Path("other.csv")), ReadFile(Path("sweep/load.csv")));
  ASSERT_EQ(rows.size(), 6u) << load.out;
  double capacity = 0;
  for (const Row& row : rows) {
    EXPECT_EQ(row.at("ok"), row.at("sent"));
    EXPECT_GT(std::stod(row.at("p50_ms")), 0);
    if (row.at("loop") == "closed") capacity += std::stod(row.at("ok_per_s"));
  }
  for (std::size_t i = 2; i < rows.size(); ++i) {
    EXPECT_EQ(rows[i].at("loop"), "open");
    EXPECT_EQ(rows[i].at("share"), i < 4 ? "0.1" : "0.3");
    const double offered = std::stod(rows[i].at("offered_per_s"));
    EXPECT_NEAR(offered, std::stod(rows[i].at("share")) * capacity, 0.01 * offered);
    // Of a run whose sends were late there is no tail, and a line says so.
    const bool told = load.err.find("so there is no p99") != std::string::npos;
    if (rows[i].at("p99_ms").empty() && std::stoi(rows[i].at("ok")) >= 100) {
      EXPECT_TRUE(told);
    }
  }
  // The map that it gathered from is gone; those that it built go by their time to live.
  std::istringstream maps(Run("maps list").out);
  for (std::string line; std::getline(maps, line);) {
    if (line.starts_with("load-")) {
      EXPECT_THAT(line, HasSubstr(".build"));
    }
  }
  if (load.err.find("no charts") != std::string::npos) GTEST_SKIP() << load.err;
  EXPECT_THAT(ReadFile(Path("sweep/load.png")), StartsWith("\x89PNG"));
  EXPECT_THAT(ReadFile(Path("sweep/load.svg")), HasSubstr("offered requests/s"));
}

TEST_F(LoadCommandTest, ChartsAreDrawnFromACsvWithoutAServer) {
  const std::string head =
      "kind,loop,share,offered_per_s,sent,ok,refused,failed,late,ok_per_s,p50_ms,p90_ms,p99_ms,"
      "p999_ms,max_ms\n";
  std::ofstream(Path("a.csv")) << head << "gather,closed,,,9,9,0,0,0,100,1,1,1,1,1\n"
                               << "gather,open,0.5,50,9,9,0,0,0,50,1,1,2,3,3\n"
                               << "gather,open,1.2,120,9,9,0,0,5,99,40,90,,,100\n";
  const Outcome drawn = Run("load --from a.csv --output charts");
  if (drawn.err.find("no charts") != std::string::npos) GTEST_SKIP() << drawn.err;
  ASSERT_EQ(drawn.exit_code, 0) << drawn.err;
  const std::string chart = ReadFile(Path("charts/load.svg"));
  for (const char* label : {"gather 50 %", "gather 99.9 %", "closed loop", "answered requests/s"}) {
    EXPECT_THAT(chart, HasSubstr(label));
  }
  std::ofstream(Path("b.csv")) << head << "gather,open,1,fast,9,9,0,0,0,50,1,1,2,3,3\n";
  EXPECT_THAT(FailingRun("load --from b.csv --output charts", 1),
              HasSubstr("b.csv:2: offered_per_s is 'fast', no number"));
  std::ofstream(Path("c.csv")) << "x,y\n1,2\n";
  EXPECT_THAT(FailingRun("load --from c.csv --output charts", 1),
              HasSubstr("c.csv:1: the columns are not those of a load"));
}

TEST_F(LoadCommandTest, AFileThatIsNoTableOfALoadIsNamed) {
  std::ofstream(Path("cut.csv")) << "kind,loop,share,offered_per_s,sent,ok,refused,failed,late,"
                                    "ok_per_s,p50_ms,p90_ms,p99_ms,p999_ms,max_ms\n"
                                 << "gather,open,,20,30,3";
  std::ofstream(Path("bytes.csv")) << "\xff\xfe\x80";
  const Outcome cut = Run("load --from cut.csv --output charts");
  if (cut.err.find("matplotlib") != std::string::npos) GTEST_SKIP() << cut.err;
  EXPECT_EQ(cut.exit_code, 1);
  EXPECT_THAT(cut.err, HasSubstr("cut.csv:2: the row has fewer values than there are columns"));
  EXPECT_THAT(cut.err, Not(HasSubstr("are written")));
  EXPECT_THAT(FailingRun("load --from bytes.csv --output charts", 1),
              HasSubstr("bytes.csv: it is no CSV file"));
  EXPECT_THAT(FailingRun("load --from charts --output charts", 1),
              HasSubstr("charts: Is a directory"));
}

TEST_F(LoadCommandTest, WhatCannotBeIsSaidBeforeAnyWork) {
  // No server is there yet.
  EXPECT_THAT(FailingRun("load --csv none/x.csv", 1), HasSubstr("cannot write none/x.csv"));
  Serve();
  EXPECT_THAT(FailingRun("load --photons 1000000000", 1),
              HasSubstr("--photons is 1000000000, the server takes at most 100000000 "
                        "(--max-photons of treelightd)"));
  EXPECT_THAT(FailingRun("load --builds 0.5 --build-photons 1000000000", 1),
              HasSubstr("--build-photons is 1000000000"));
  // Requests are drawn as they are due: all of them would take 690 GB.
  const pid_t pid = Start("load --rates 1000000 --duration 86400 --photons 10 --queries 1");
  ASSERT_TRUE(Eventually([&] { return Gathers() > 5; }));
  kill(pid, SIGINT);
  EXPECT_EQ(End(pid).exit_code, 130);
}

TEST_F(LoadCommandTest, AnInterruptTellsWhatThereIsAndDeletesTheMap) {
  Serve();
  for (const char* loop : {"--rates 50,20", "--sweep 0.5"}) {
    std::filesystem::remove_all(Path("cut"));
    const std::size_t answered = Gathers();
    const pid_t pid = Start(fmt::format(
        "load {} --duration 600 --photons 2000 --queries 20 --builds 0.1 --output cut", loop));
    ASSERT_TRUE(Eventually([&] { return Gathers() > answered + 5; }));
    kill(pid, SIGINT);
    const Outcome load = End(pid);
    EXPECT_EQ(load.exit_code, 130) << load.err;
    EXPECT_THAT(load.err, HasSubstr("treelight: interrupted"));
    EXPECT_THAT(load.out, HasSubstr("(interrupted)"));
    const auto rows = ReadCsv(Path("cut/load.csv"));
    ASSERT_FALSE(rows.empty());
    EXPECT_EQ(rows[0].at("kind"), "gather");
    EXPECT_GT(std::stoi(rows[0].at("ok")), 0);
    EXPECT_THAT(Run("maps list").out, Not(ContainsRegex("load-[0-9a-f]+ ")));
  }
}

TEST_F(LoadCommandTest, WhatContradictsItselfIsRefused) {
  EXPECT_THAT(FailingRun("load --rates 5 --sweep 0.5", 2), HasSubstr("--rates excludes --sweep"));
  EXPECT_THAT(FailingRun("load --from a.csv", 2), HasSubstr("--from requires --output"));
  EXPECT_THAT(FailingRun("load --sweep 0", 2), HasSubstr("--sweep"));
  EXPECT_THAT(FailingRun("load --builds 1.5", 2), HasSubstr("--builds"));
  EXPECT_THAT(FailingRun("load --arrivals burst", 2),
              HasSubstr("--arrivals: 'burst' is neither poisson nor constant"));
  EXPECT_THAT(FailingRun("load --arrivals 1", 2), HasSubstr("neither poisson nor constant"));
  EXPECT_THAT(FailingRun("load --from missing.csv --output charts", 1),
              HasSubstr("missing.csv: there is no such file"));
}

}  // namespace
}  // namespace treelight::testing
