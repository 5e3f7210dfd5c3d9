#include "client/trace/photon_tracer.h"

#include <algorithm>
#include <optional>
#include <vector>

#include "client/trace/lights.h"
#include "client/trace/photon_path.h"
#include "client/trace/targets.h"
#include "tbb/parallel_for.h"

namespace treelight::client {
namespace {

constexpr std::uint64_t kPathsPerBatch = 2048;
constexpr std::uint64_t kMaxBatchesPerRound = 128;  // with some 20 MiB of photons
/// A set is given up when fewer photons than this come from a path, over so many paths.
constexpr double kMinPhotonsPerPath = 1e-4;
constexpr std::uint64_t kPathsBeforeGivingUp = 1'000'000;

PhotonBatch TraceBatch(const PhotonPaths& paths, std::uint64_t first, std::uint64_t count) {
  PhotonBatch batch;
  for (std::uint64_t i = first; i < first + count; ++i) TracePath(paths, i, batch);
  return batch;
}

/// How many batches should still be needed. A surplus is thrown away, so the guess changes no
/// photon.
std::uint64_t GuessBatches(const PhotonSetReport& report, std::uint64_t wanted) {
  const double per_path =
      report.paths == 0
          ? 1
          : std::max(static_cast<double>(report.photons) / static_cast<double>(report.paths),
                     kMinPhotonsPerPath);
  const auto paths = static_cast<double>(wanted - report.photons) / per_path;
  return std::clamp<std::uint64_t>(static_cast<std::uint64_t>(paths) / kPathsPerBatch + 1, 1,
                                   kMaxBatchesPerRound);
}

bool IsGivenUp(const PhotonSetReport& report) {
  return report.paths > kPathsBeforeGivingUp &&
         static_cast<double>(report.photons) <
             static_cast<double>(report.paths) * kMinPhotonsPerPath;
}

void AddTo(PhotonSetReport& report, const PhotonBatch& batch) {
  report.photons += batch.photons.size();
  report.paths += batch.stored_until.size();
  report.rays += batch.rays;
  const std::vector<float>& powers = batch.photons.powers;
  for (std::size_t i = 0; i < powers.size(); ++i) {
    report.stored[i % 3] += powers[i];
    report.max_power = std::max(report.max_power, powers[i]);
  }
}

/// Traces paths until `wanted` photons are stored. Adds to `energy`.
absl::StatusOr<PhotonSetReport> TraceSet(const PhotonPaths& paths, std::uint64_t wanted,
                                         const PhotonSink& sink,
                                         const std::function<void(std::uint64_t)>& progress,
                                         const std::function<bool()>& cancelled,
                                         EnergyBalance& energy) {
  PhotonSetReport report;
  std::vector<PhotonBatch> round;
  while (report.photons < wanted && !IsGivenUp(report)) {
    if (cancelled && cancelled()) return absl::CancelledError("tracing was cancelled");
    round.assign(GuessBatches(report, wanted), {});
    tbb::parallel_for(std::size_t{0}, round.size(), [&](std::size_t i) {
      round[i] = TraceBatch(paths, report.paths + i * kPathsPerBatch, kPathsPerBatch);
    });
    for (PhotonBatch& batch : round) {
      const std::uint64_t missing = wanted - report.photons;
      if (batch.photons.size() >= missing) {
        // Trace the batch again up to the path that reaches the count.
        const auto last = std::ranges::lower_bound(batch.stored_until, missing);
        batch = TraceBatch(paths, report.paths, last - batch.stored_until.begin() + 1);
      }
      if (const auto status = sink(paths.set, batch.photons); !status.ok()) return status;
      AddTo(report, batch);
      Add(energy, batch.energy);
      if (report.photons >= wanted) break;
    }
    if (progress) progress(report.photons);
  }
  const double share = 1 / static_cast<double>(report.paths);
  Scale(report.stored, share);
  Scale(energy, share);
  report.max_power *= 1 / static_cast<float>(report.paths);
  return report;
}

void DividePower(Photons& photons, std::uint64_t paths) {
  const auto share = 1 / static_cast<float>(paths);
  for (float& power : photons.powers) power *= share;
}

}  // namespace

absl::StatusOr<TraceReport> TracePhotons(const Intersector& intersector,
                                         const PhotonTraceOptions& options,
                                         const PhotonSink& sink) {
  if (options.indirect_photons == 0 && options.caustic_photons == 0)
    return absl::InvalidArgumentError("indirect_photons and caustic_photons are 0");
  if (options.max_bounces == 0) return absl::InvalidArgumentError("max_bounces is 0");
  std::optional<PhotonEmitters> own_emitters;
  if (options.emitters == nullptr) own_emitters.emplace(intersector.scene());
  const auto& [lights, targets] = own_emitters ? *own_emitters : *options.emitters;
  if (lights.empty()) return absl::FailedPreconditionError("the scene has no light");

  TraceReport report;
  PhotonPaths paths{.intersector = intersector,
                    .lights = lights,
                    .targets = nullptr,
                    .set = PhotonSet::kIndirect,
                    .seed = options.seed,
                    .max_bounces = options.max_bounces};
  if (options.indirect_photons > 0) {
    const auto set = TraceSet(paths, options.indirect_photons, sink, options.progress,
                              options.cancelled, report.energy);
    if (!set.ok()) return set.status();
    report.indirect = *set;
  }
  if (options.caustic_photons > 0 && !targets.empty()) {
    paths.set = PhotonSet::kCaustic;
    paths.max_specular = MaxSpecular(intersector.scene());
    if (options.caustic_emission == CausticEmission::kTargeted) paths.targets = &targets;
    const auto progress = [&](std::uint64_t photons) {
      if (options.progress) options.progress(report.indirect.photons + photons);
    };
    EnergyBalance unused;  // these paths are not followed to their ends
    const auto set =
        TraceSet(paths, options.caustic_photons, sink, progress, options.cancelled, unused);
    if (!set.ok()) return set.status();
    report.caustic = *set;
  }
  if (report.indirect.photons + report.caustic.photons == 0) {
    return absl::FailedPreconditionError(
        "no photon was stored: the light reaches diffuse surfaces only directly, or not at all");
  }
  return report;
}

absl::StatusOr<TracedPhotons> TracePhotons(const Intersector& intersector,
                                           const PhotonTraceOptions& options) {
  TracedPhotons traced;
  auto report = TracePhotons(intersector, options, [&traced](PhotonSet set, const Photons& block) {
    Append(set == PhotonSet::kIndirect ? traced.indirect : traced.caustic, block);
    return absl::OkStatus();
  });
  if (!report.ok()) return report.status();
  traced.report = *report;
  DividePower(traced.indirect, traced.report.indirect.paths);
  DividePower(traced.caustic, traced.report.caustic.paths);
  return traced;
}

}  // namespace treelight::client
