#include "client/commands/render_report.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

/// Time of stage `name` of a build; a blank where it has none.
std::string StageTime(const std::optional<v1::BuildPhotonMapResponse>& built,
                      const std::string& name) {
  if (!built) return "-";
  for (const v1::StageTime& stage : built->map().build_stages()) {
    if (stage.stage() == name) return FormatMicroseconds(stage.microseconds());
  }
  return "-";
}

std::string PerSecond(std::uint64_t queries, double seconds) {
  return queries > 0 && seconds > 0 ? fmt::format("{:.0f}", static_cast<double>(queries) / seconds)
                                    : "-";
}

std::string Mean(const std::optional<TraversalCost>& traversal, double TraversalCost::*count) {
  return traversal ? fmt::format("{:.1f}", *traversal.*count) : "-";
}

Table MapTable(const TracedPhotons& photons, const UploadedMaps& maps, const GatherRadii& radii,
               const PhotonRenderedImage& render, const MapTraversals& traversals,
               double render_s) {
  Table table{.head = {"", "indirect map", "caustic map"}, .rows = {}};
  const auto row = [&table](const std::string& name, const std::string& a, const std::string& b) {
    table.rows.push_back({name, a, b});
  };
  row("photons", fmt::to_string(photons.indirect.size()), fmt::to_string(photons.caustic.size()));
  // The same builder made both maps: their stages are the same.
  if (const auto& built = maps.indirect ? maps.indirect : maps.caustic) {
    for (const v1::StageTime& stage : built->map().build_stages()) {
      row("build: " + stage.stage(), StageTime(maps.indirect, stage.stage()),
          StageTime(maps.caustic, stage.stage()));
    }
  }
  const auto total = [](const auto& built) {
    return built ? FormatMicroseconds(built->timings().total_us()) : "-";
  };
  row("receive and build", total(maps.indirect), total(maps.caustic));
  const GatherCost &a = render.indirect, &b = render.caustic;
  row("gathers", fmt::to_string(a.queries), fmt::to_string(b.queries));
  const auto radius = [](const std::optional<float>& value, bool has_map) {
    return value && has_map ? fmt::format("{:.3g}", *value) : "-";
  };
  row("gathers: largest radius, scene units", radius(radii.indirect, maps.indirect.has_value()),
      radius(radii.caustic, maps.caustic.has_value()));
  row("gathers: messages", fmt::to_string(a.messages), fmt::to_string(b.messages));
  row("gathers: kernels", FormatMicroseconds(a.kernel_us), FormatMicroseconds(b.kernel_us));
  row("gathers: to the device and back", FormatMicroseconds(a.transfer_us),
      FormatMicroseconds(b.transfer_us));
  row("gathers/s of kernel time", PerSecond(a.queries, 1e-6 * a.kernel_us),
      PerSecond(b.queries, 1e-6 * b.kernel_us));
  row("gathers/s of wall time (picture, both maps at once)", PerSecond(a.queries, render_s),
      PerSecond(b.queries, render_s));
  if (a.merged + b.merged > 0) {
    const auto merged = [](const GatherCost& cost) {
      return fmt::format("{}, off by {:.2g}", cost.merged, cost.merged_error);
    };
    row("gathers: from merged photons, error measured of them", merged(a), merged(b));
  }
  const auto sampled = [](const std::string& what) {
    return fmt::format("{} per gather (sample: 1 of {})", what, kSampleStride);
  };
  row(sampled("nodes"), Mean(traversals.indirect, &TraversalCost::nodes_per_query),
      Mean(traversals.caustic, &TraversalCost::nodes_per_query));
  row(sampled("photons compared"), Mean(traversals.indirect, &TraversalCost::tests_per_query),
      Mean(traversals.caustic, &TraversalCost::tests_per_query));
  return table;
}

}  // namespace

std::string FormatEnergy(const TracedPhotons& photons) {
  const auto sum = [](const Power& power) { return power[0] + power[1] + power[2]; };
  const EnergyBalance& energy = photons.report.energy;
  const double percent = 100 / sum(energy.emitted);
  // Of either sign: what rounds to nothing has none.
  const double roulette = std::round(1e4 * sum(energy.roulette) / sum(energy.emitted)) / 100 + 0.0;
  return fmt::format(
      "light: {:.3f} W on {} paths = {:.2f} % absorbed + {:.2f} % escaped {:+.2f} % roulette + "
      "{:.2f} % cut off\n",
      sum(energy.emitted), photons.report.indirect.paths,
      percent * (sum(energy.absorbed_diffuse) + sum(energy.absorbed_elsewhere)),
      percent * sum(energy.escaped), roulette, percent * sum(energy.cut));
}

std::string FormatRender(const TracedPhotons& photons, const UploadedMaps& maps,
                         const GatherRadii& radii, const PhotonRenderedImage& render,
                         const MapTraversals& traversals, const RenderTimes& times) {
  const auto mega = [](std::uint64_t rays, double seconds) {
    return seconds > 0 ? static_cast<double>(rays) / seconds / 1e6 : 0;
  };
  const double shorter = std::min(render.camera_s, render.device_s());
  return Format(MapTable(photons, maps, radii, render, traversals, times.render_s)) +
         FormatEnergy(photons) +
         fmt::format(
             "time: photons {:.2f} s ({:.1f} Mrays/s), upload and build {:.2f} s, picture {:.2f} "
             "s, "
             "in all {:.2f} s\n"
             "picture: camera {:.2f} s ({:.1f} Mrays/s), server's device {:.2f} s, both at once "
             "for "
             "at least {:.2f} s, {:.0f} % of the shorter; waited {:.2f} s for answers\n",
             times.trace_s,
             mega(photons.report.indirect.rays + photons.report.caustic.rays, times.trace_s),
             times.build_s, times.render_s, times.whole_s, render.camera_s,
             mega(render.rays, render.camera_s), render.device_s(), render.overlap_s(),
             shorter > 0 ? 100 * render.overlap_s() / shorter : 0, render.wait_s());
}

std::string FormatError(const ImageError& error, const std::string& reference_path) {
  return fmt::format(
      "against {}: RMSE {:.4f} ({:.4f} with radiances clipped at {}), relative MSE {:.5f}, mean "
      "{:+.2f} %\n",
      reference_path, error.rmse, error.clipped_rmse, kClip, error.relative_mse,
      100 * (error.mean_ratio - 1));
}

}  // namespace treelight::client
