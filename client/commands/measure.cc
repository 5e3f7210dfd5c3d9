#include <cstdint>
#include <memory>
#include <string>

#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/map_option.h"
#include "client/commands/server_option.h"
#include "client/query_file.h"
#include "client/remote_map.h"
#include "client/study/sample.h"
#include "client/table.h"
#include "core/search_statistics.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  MapRef map;
  std::string queries_path;
  std::uint32_t count = 1000, seed = 1;
};

absl::Status Run(const Options& options, const GlobalOptions& global) {
  const auto points = ReadQueryFile(options.queries_path);
  if (!points.ok()) return points.status();
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto map = (*client)->GetPhotonMap(options.map);
  if (!map.ok()) return map.status();
  const auto queries = SamplePositions(points->positions, options.count, options.seed);
  const auto searches = MeasureSearches(RemoteMap(**client, *map), queries);
  if (!searches.ok()) return searches.status();
  const auto row = [](const char* search, double nodes, const std::string& tests) {
    return std::vector<std::string>{search, fmt::format("{:.2f}", nodes), tests};
  };
  const auto number = [](double tests) { return fmt::format("{:.2f}", tests); };
  fmt::print(
      "{}@{}, {} searches\n{}", map->name(), map->version(), queries.size() / 3,
      Format({.head = {"search", "nodes", "distance tests"},
              .rows = {row("the photon there", searches->exact_nodes, ""),
                       row("the 50 nearest", searches->knn50_nodes, number(searches->knn50_tests)),
                       row("all within their distance", searches->r50_nodes,
                           number(searches->r50_tests))}}));
  return absl::OkStatus();
}

}  // namespace

void AddMeasureCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "measure", "What searches cost in a map: nodes visited and distance tests, means");
  AddMapOption(*command, "--map", options->map)->required();
  command
      ->add_option("--queries", options->queries_path,
                   "PLY or CSV file of points, as of gather: the photons of the map, for one")
      ->required();
  command->add_option("--count", options->count, "Points taken of the file, chosen at random")
      ->capture_default_str()
      ->check(CLI::Range(1u, 1'000'000u));
  command->add_option("--seed", options->seed, "Of the choice")
      ->capture_default_str()
      ->check(WithoutSign());
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
