#include "client/commands/map_table.h"

#include "client/commands/build_options.h"
#include "client/commands/output.h"
#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

std::string Contents(const v1::PhotonMap& map) {
  std::string contents = "positions";
  if (map.has_powers()) contents += ", powers";
  if (map.has_directions()) contents += ", directions";
  return contents;
}

// Time and share of each stage, and their sum.
std::string FormatStages(const v1::PhotonMap& map) {
  double sum = 0;
  for (const v1::StageTime& stage : map.build_stages()) sum += stage.microseconds();
  Table table{.head = {"stage", "time", "share"}, .rows = {}};
  const auto add = [&](const std::string& name, double microseconds) {
    const double share = sum > 0 ? 100 * microseconds / sum : 0;
    table.rows.push_back({name, FormatMicroseconds(microseconds), fmt::format("{:.1f} %", share)});
  };
  for (const v1::StageTime& stage : map.build_stages()) add(stage.stage(), stage.microseconds());
  add("all stages", sum);
  return Format(table);
}

}  // namespace

std::string FormatMap(const v1::PhotonMap& map) {
  const v1::TreeStatistics& tree = map.statistics();
  Table table{
      .head = {},
      .rows = {
          {"map", fmt::format("{}@{}", map.name(), map.version())},
          {"photons", fmt::format("{} ({})", map.photon_count(), Contents(map))},
          {"device", map.device()},
          {"device memory", FormatBytes(static_cast<double>(map.device_bytes()))},
          {"created", FormatTime(map.created_unix_ms()) + " UTC"},
          {"expires",
           map.expires_unix_ms() == 0 ? "never" : FormatTime(map.expires_unix_ms()) + " UTC"},
          {"options", DescribeOptions(map)},
          {"tree",
           fmt::format(
               "{} inner nodes, {} leaves of {:.2f} photons, depth {} (mean {:.1f}), SAH {:.2f}",
               tree.node_count(), tree.leaf_count(), tree.leaf_fill(), tree.depth(),
               tree.mean_leaf_depth(), tree.sah_cost()) +
               (tree.isa_cost() > 0 ? fmt::format(", isa {:.2f}", tree.isa_cost()) : "")}}};
  if (!map.choice().empty()) table.rows.push_back({"chosen", map.choice()});
  std::string text = Format(table);
  if (map.build_stages().empty()) return text;
  text.push_back('\n');
  return text + FormatStages(map);
}

}  // namespace treelight::client
