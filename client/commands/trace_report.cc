#include "client/commands/trace_report.h"

#include <cmath>

#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

double Sum(const Power& power) { return power[0] + power[1] + power[2]; }

/// A row of red, green and blue, and the share of `whole`.
std::vector<std::string> PowerRow(const std::string& name, const Power& power, double whole) {
  // What rounds to nothing has no sign.
  const double percent = std::round(1e4 * Sum(power) / whole) / 100 + 0.0;
  return {name, fmt::format("{:.4g}", power[0]), fmt::format("{:.4g}", power[1]),
          fmt::format("{:.4g}", power[2]), fmt::format("{:.2f} %", percent)};
}

std::string FormatSets(const TraceReport& report) {
  Table table{.head = {"", "indirect", "caustic"}, .rows = {}};
  const PhotonSetReport &a = report.indirect, &b = report.caustic;
  const auto row = [&table](const std::string& name, const std::string& x, const std::string& y) {
    table.rows.push_back({name, x, y});
  };
  row("photons", fmt::to_string(a.photons), fmt::to_string(b.photons));
  row("paths", fmt::to_string(a.paths), fmt::to_string(b.paths));
  const auto per_path = [](const PhotonSetReport& set) {
    return set.paths == 0 ? std::string("-")
                          : fmt::format("{:.3f}", static_cast<double>(set.photons) /
                                                      static_cast<double>(set.paths));
  };
  row("photons per path", per_path(a), per_path(b));
  row("rays", fmt::to_string(a.rays), fmt::to_string(b.rays));
  row("stored power, W", fmt::format("{:.4g}", Sum(a.stored)),
      fmt::format("{:.4g}", Sum(b.stored)));
  return Format(table);
}

std::string FormatEnergy(const EnergyBalance& energy) {
  const double whole = Sum(energy.emitted);
  Table table{.head = {"power, W", "red", "green", "blue", "share"}, .rows = {}};
  const auto row = [&](const std::string& name, const Power& power) {
    table.rows.push_back(PowerRow(name, power, whole));
  };
  row("emitted", energy.emitted);
  row("= absorbed where photons are stored", energy.absorbed_diffuse);
  row("+ absorbed by mirrors, glass and panes", energy.absorbed_elsewhere);
  row("+ escaped from the scene", energy.escaped);
  if (Sum(energy.shading) != 0) row("+ taken by shading normals, net", energy.shading);
  row("+ taken by Russian roulette, net", energy.roulette);
  row("+ cut off after --max-bounces", energy.cut);
  row("arrived at diffuse surfaces: direct", energy.direct);
  row("  stored, indirect", energy.indirect);
  row("  caustic, by these paths", energy.caustic);
  return Format(table);
}

}  // namespace

std::string FormatTrace(const TraceReport& report, double seconds) {
  std::string text = fmt::format("photons: {} = {} indirect + {} caustic\n",
                                 report.indirect.photons + report.caustic.photons,
                                 report.indirect.photons, report.caustic.photons);
  text += FormatSets(report);
  if (report.indirect.paths > 0) text += FormatEnergy(report.energy);
  const auto rays = static_cast<double>(report.indirect.rays + report.caustic.rays);
  return text + fmt::format("time: {:.2f} s, {:.1f} Mrays/s\n", seconds,
                            seconds > 0 ? rays / seconds / 1e6 : 0);
}

}  // namespace treelight::client
