#include "client/commands/render_progressive.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <random>
#include <string>
#include <utility>

#include "client/commands/interrupt.h"
#include "client/commands/output.h"
#include "client/commands/server_option.h"
#include "client/output_file.h"
#include "client/progress.h"
#include "client/render/planned_renderer.h"
#include "client/render/progressive_chart.h"
#include "client/render/progressive_renderer.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

/// FOLDER/progressive.csv, and the chart of it.
class ErrorCurve {
 public:
  static absl::StatusOr<ErrorCurve> Open(const std::string& folder) {
    ErrorCurve curve;
    if (folder.empty()) return curve;
    if (auto status = MakeFolder(folder); !status.ok()) return status;
    curve.folder_ = folder;
    curve.path_ = (std::filesystem::path(folder) / "progressive.csv").string();
    if (auto status = curve.Begin(); !status.ok()) return status;
    return curve;
  }

  /// Drops the passes that were added.
  absl::Status Restart() { return file_ ? Begin() : absl::OkStatus(); }

  absl::Status Add(const PassReport& pass, const std::optional<ImageError>& measured) {
    return file_ ? file_->Write(ErrorCurveLine(pass, measured)) : absl::OkStatus();
  }

  /// Also where the run failed: what was measured stays. A chart that cannot be drawn is a warning.
  absl::Status Close() {
    if (!file_) return absl::OkStatus();
    if (auto status = file_->Commit(); !status.ok()) return status;
    if (const auto status = DrawErrorCurve(path_, folder_); !status.ok())
      Warn(std::string(status.message()));
    return absl::OkStatus();
  }

 private:
  ErrorCurve() = default;

  absl::Status Begin() {
    file_.reset();  // before another of that name
    auto file = OutputFile::Create(path_);
    if (!file.ok()) return file.status();
    file_ = *std::move(file);
    return file_->Write(ErrorCurveHeader());
  }

  std::string folder_, path_;
  std::optional<OutputFile> file_;
};

const char* NameOf(ProgressiveEnd end) {
  switch (end) {
    case ProgressiveEnd::kPasses:
      return "all passes are done";
    case ProgressiveEnd::kTargetError:
      return "the target error is reached";
    case ProgressiveEnd::kTimeLimit:
      return "the time is up";
    case ProgressiveEnd::kTooBlurred:
      return "the first radius blurs too much";
    case ProgressiveEnd::kInterrupted:
      break;
  }
  return "interrupted";
}

std::string FormatEstimate(const ErrorEstimate& error) {
  std::string text =
      fmt::format("estimated error: {:.4f} (relative, root mean square) = noise {:.4f}",
                  error.relative_rms(), std::sqrt(error.variance));
  text += error.knows_bias ? fmt::format(" and blur {:.4f}", std::sqrt(error.squared_bias))
                           : std::string("; blur unknown");
  return text + "\n";
}

std::string FormatRun(const ProgressiveResult& result) {
  const PassReport& last = result.last;
  const auto radius = [](const EstimateOptions& estimate) {
    return estimate.radius > 0 ? fmt::format("{:.3g}", estimate.radius) : std::string("none");
  };
  std::string text = fmt::format("{} pass{} in {:.2f} s: {}\n", last.passes,
                                 last.passes == 1 ? "" : "es", last.seconds, NameOf(result.end));
  if (last.error) text += FormatEstimate(*last.error);
  text += fmt::format("photons: {}; last radius of indirect light {}, of caustics {}\n",
                      last.photons, radius(last.indirect), radius(last.caustic));
  // What does not fit one after the other was done at once.
  const double both = result.photons_s + result.pictures_s;
  text += fmt::format(
      "time: photons and maps {:.2f} s, pictures {:.2f} s, at once for at least {:.2f} s; pictures "
      "waited {:.2f} s for maps\n",
      result.photons_s, result.pictures_s, std::max(0.0, both - last.seconds), result.waited_s);
  return text;
}

ProgressiveOptions OptionsOf(const RenderChoice& choice) {
  ProgressiveOptions options;
  const auto first_radius = [](std::uint32_t k, std::optional<float> given, FirstRadius& first) {
    first.given = given;
    if (k > 0) first.k = k;
  };
  options.pass = choice.photon_options(choice.radii);
  options.pass.camera.samples_per_pixel = choice.samples_per_pixel.value_or(1);
  first_radius(choice.render.indirect.k, choice.radii.indirect, options.indirect);
  first_radius(choice.render.caustic.k, choice.radii.caustic, options.caustic);
  options.indirect_photons = choice.photon_count;
  options.caustic_photons = choice.caustic_photon_count;
  options.seed = choice.seed;
  options.map_name = fmt::format(
      "{}.{:08x}", choice.map_name.empty() ? SceneName(choice.scene.scene) : choice.map_name,
      std::random_device{}());
  options.max_passes = choice.max_passes();
  options.target_error = choice.target_error;
  options.time_limit_s = choice.time_limit_s.value_or(options.time_limit_s);
  options.interrupted = &InterruptGuard::interrupted;
  return options;
}

std::string FormatPilot(const PilotReport& pilot) {
  const PilotFindings& found = pilot.findings;
  return fmt::format(
      "pilot: {} photons in {:.2f} s; noise of a sample {:.3f}, {:.0f} % of its square left within "
      "a quarter of the pixel; of {} photons {:.3f}, {:.0f} % of it shared by the samples of a "
      "pixel\n",
      pilot.photons, pilot.seconds, std::sqrt(found.camera_variance), 100 * found.within_quarter,
      found.k, std::sqrt(found.photon_variance), 100 * found.shared);
}

std::string FormatPlan(const PassPlan& plan, double target_error) {
  return fmt::format(
      "plan: {} passes of {} photons, k {} and {} sample{} a pixel: noise {:.4f} and blur {:.4f}, "
      "error {:.4f} of {:.4g} in {:.2f} s{}\n",
      plan.passes, plan.photons, plan.k, plan.samples_per_pixel,
      plan.samples_per_pixel == 1 ? "" : "s", std::sqrt(plan.variance),
      std::sqrt(plan.squared_bias), std::sqrt(plan.variance + plan.squared_bias), target_error,
      plan.seconds,
      plan.squared_bias < target_error * target_error ? "" : "; radii shrink from there on");
}

/// What `choice` leaves to a pilot.
PlanLimits LimitsOf(const RenderChoice& choice) {
  PlanLimits limits{.samples_per_pixel = choice.samples_per_pixel};
  if (choice.gives_k) limits.k = choice.render.indirect.k;
  return limits;
}

}  // namespace

absl::Status RenderInPasses(const Intersector& scene, const RenderChoice& choice,
                            const GlobalOptions& global, const Viewer& viewer) {
  const auto connected = Connect(global);
  if (!connected.ok()) return connected.status();
  PhotonMapClient& client = **connected;
  // Before any work: is there a server, and can the curve be written?
  if (const auto info = client.GetServerInfo(); !info.ok()) return info.status();
  auto curve = ErrorCurve::Open(choice.error_curve_folder);
  if (!curve.ok()) return curve.status();

  const InterruptGuard guard;
  ProgressiveOptions options = OptionsOf(choice);
  const PhotonEmitters emitters(scene.scene());
  options.emitters = &emitters;
  options.preview = viewer.preview;
  std::uint64_t passes = 0;
  // Of how many it will be is known where nothing else ends them.
  std::optional<Progress> progress;
  if (choice.passes) progress.emplace("render", *choice.passes, "passes");
  options.pass_done = [&](const PassReport& pass, const PassStatistics& statistics) {
    passes = pass.passes;
    if (progress) progress->Update(passes);
    if (viewer.reference == nullptr) return curve->Add(pass, std::nullopt);
    const auto measured = Compare(statistics.Mean(), *viewer.reference);
    return measured.ok() ? curve->Add(pass, *measured) : measured.status();
  };
  const auto planned = [&](const PilotPlan& found) {
    fmt::print("{}{}",
               passes == 0 ? FormatPilot(found.pilot)
                           : "these passes are more blurred than planned, and dropped\n",
               FormatPlan(found.plan, options.target_error));
    return passes > 0 ? curve->Restart() : absl::OkStatus();
  };
  const auto rendered = choice.auto_photons
                            ? RenderPlanned(scene, client, options, LimitsOf(choice), planned)
                            : RenderProgressively(scene, client, options);
  progress.reset();
  const auto closed = curve->Close();
  if (!rendered.ok()) {
    if (passes == 0) return rendered.status();
    return absl::Status(
        rendered.status().code(),
        fmt::format("{} (after {} pass{}{})", std::string(rendered.status().message()), passes,
                    passes == 1 ? "" : "es",
                    choice.preview_path.empty() ? std::string()
                                                : ", which " + choice.preview_path + " shows"));
  }
  if (auto status = viewer.finish(rendered->image); !status.ok()) return status;
  if (!rendered->deleted.ok()) {
    Warn(fmt::format("not all maps are deleted, the server does that after {} min: {}",
                     std::chrono::duration_cast<std::chrono::minutes>(options.time_to_live).count(),
                     std::string(rendered->deleted.message())));
  }
  fmt::print("{}", FormatRun(*rendered));
  return closed;
}

}  // namespace treelight::client
