#include "client/trace/photon_tracer.h"

#include <algorithm>
#include <vector>

#include "client/trace/lights.h"
#include "client/trace/random.h"
#include "client/trace/scatter.h"
#include "core/model/octahedral.h"
#include "fmt/format.h"
#include "tbb/parallel_for.h"

namespace treelight::client {
namespace {

constexpr std::uint64_t kPathsPerBatch = 2048;
constexpr std::uint64_t kMaxBatchesPerRound = 512;
/// A scene that stores fewer photons per path than this is given up.
constexpr double kMinPhotonsPerPath = 1e-4;

void Add(EnergyBalance::Power& sum, const Rgb& power) {
  sum[0] += power.r, sum[1] += power.g, sum[2] += power.b;
}

void Add(EnergyBalance::Power& sum, const EnergyBalance::Power& power) {
  for (int c = 0; c < 3; ++c) sum[c] += power[c];
}

void Scale(EnergyBalance::Power& power, double factor) {
  for (double& channel : power) channel *= factor;
}

void Append(Photons& photons, const Vec3& position, const Rgb& power, const Vec3& direction) {
  photons.positions.insert(photons.positions.end(), {position.x, position.y, position.z});
  photons.powers.insert(photons.powers.end(), {power.r, power.g, power.b});
  const auto encoded = EncodeOctahedral(direction);
  photons.directions.insert(photons.directions.end(), encoded.begin(), encoded.end());
}

void Append(Photons& photons, const Photons& more) {
  const auto append = [](auto& to, const auto& from) {
    to.insert(to.end(), from.begin(), from.end());
  };
  append(photons.positions, more.positions);
  append(photons.powers, more.powers);
  append(photons.directions, more.directions);
}

/// Paths of consecutive indices. Powers are those of one path: not yet divided by the number of
/// paths.
struct Batch {
  Photons indirect, caustic;
  std::vector<std::uint32_t> stored_until;  // photons in both sets after each path
  EnergyBalance energy;
  std::uint64_t rays = 0;

  std::uint64_t photon_count() const { return stored_until.empty() ? 0 : stored_until.back(); }
};

/// Decides by `u` whether a path that brings `power` to a surface lives on; sets the power it goes
/// on with.
bool Survive(const Rgb& reflectance, float u, Rgb& power, EnergyBalance& energy) {
  const Rgb reflected = reflectance * power;
  const float probability = std::min(1.0f, MaxChannel(reflected) / MaxChannel(power));
  Add(energy.absorbed, power - reflected);
  Add(energy.roulette, reflected);
  if (!(u < probability)) return false;
  power = (1 / probability) * reflected;
  Add(energy.roulette, -1 * power);
  return true;
}

void TracePath(const Intersector& intersector, const Lights& lights,
               const PhotonTraceOptions& options, std::uint64_t index, Batch& batch) {
  RandomStream random(options.seed, RandomPurpose::kPhotonPath, index);
  // Numbers are drawn in statements of their own: the order in which arguments are evaluated is
  // unspecified.
  float u = random.Uniform(), v = random.Uniform();
  const float s = random.Uniform(), t = random.Uniform();
  auto [ray, power] = SampleEmission(lights, u, v, s, t);
  Add(batch.energy.emitted, power);

  bool seen_specular = false, seen_diffuse = false;
  for (std::uint32_t bounce = 0; bounce < options.max_bounces; ++bounce) {
    ++batch.rays;
    const auto hit = intersector.Intersect(ray);
    if (!hit) return Add(batch.energy.escaped, power);
    const Surface surface = hit->material->surface;
    const float arrival = ArrivalFactor(ray, *hit);
    if ((surface == Surface::kDiffuse || surface == Surface::kGlossy) && arrival > 0) {
      if (seen_diffuse) Append(batch.indirect, hit->position, arrival * power, ray.direction);
      if (!seen_diffuse && seen_specular)
        Append(batch.caustic, hit->position, arrival * power, ray.direction);
    }
    u = random.Uniform(), v = random.Uniform();
    const auto scattering = SampleScattering(ray, *hit, PathFrom::kLight, u, v);
    if (!scattering) return Add(batch.energy.absorbed, power);
    if (!Survive(scattering->shading * scattering->weight, random.Uniform(), power, batch.energy))
      return;
    if (scattering->event == Event::kDiffuse) seen_diffuse = true;
    if (scattering->event == Event::kSpecular) seen_specular = true;
    ray = LeaveSurface(*hit, scattering->direction);
  }
  Add(batch.energy.cut, power);
}

/// Adds a batch to the result: powers and energy are still those of single paths.
void Append(TracedPhotons& traced, const Batch& batch) {
  Append(traced.indirect, batch.indirect);
  Append(traced.caustic, batch.caustic);
  traced.rays += batch.rays;
  traced.emitted_paths += batch.stored_until.size();
  Add(traced.energy.emitted, batch.energy.emitted);
  Add(traced.energy.absorbed, batch.energy.absorbed);
  Add(traced.energy.escaped, batch.energy.escaped);
  Add(traced.energy.roulette, batch.energy.roulette);
  Add(traced.energy.cut, batch.energy.cut);
}

/// Shares the power of the lights among the paths.
void DividePower(TracedPhotons& traced) {
  const double share = 1.0 / static_cast<double>(traced.emitted_paths);
  for (Photons* photons : {&traced.indirect, &traced.caustic}) {
    for (float& power : photons->powers) power = static_cast<float>(power * share);
  }
  EnergyBalance& energy = traced.energy;
  for (auto* power :
       {&energy.emitted, &energy.absorbed, &energy.escaped, &energy.roulette, &energy.cut}) {
    Scale(*power, share);
  }
}

}  // namespace

absl::StatusOr<TracedPhotons> TracePhotons(const Intersector& intersector,
                                           const PhotonTraceOptions& options) {
  if (options.photon_count == 0) return absl::InvalidArgumentError("photon_count is 0");
  if (options.max_bounces == 0) return absl::InvalidArgumentError("max_bounces is 0");
  const Lights lights(intersector.scene());
  if (lights.empty()) return absl::FailedPreconditionError("the scene has no light");
  const auto trace = [&](std::uint64_t first, std::uint64_t count) {
    Batch batch;
    for (std::uint64_t i = first; i < first + count; ++i) {
      TracePath(intersector, lights, options, i, batch);
      batch.stored_until.push_back(
          static_cast<std::uint32_t>(batch.indirect.size() + batch.caustic.size()));
    }
    return batch;
  };

  TracedPhotons traced;
  std::vector<Batch> round;
  std::uint64_t stored = 0;
  while (stored < options.photon_count) {
    // As many batches as should still be needed; a surplus is thrown away, so the guess changes no
    // photon.
    const double per_path =
        traced.emitted_paths == 0
            ? 1
            : std::max(static_cast<double>(stored) / static_cast<double>(traced.emitted_paths),
                       kMinPhotonsPerPath);
    const auto paths = static_cast<double>(options.photon_count - stored) / per_path;
    round.assign(std::clamp<std::uint64_t>(static_cast<std::uint64_t>(paths) / kPathsPerBatch + 1,
                                           1, kMaxBatchesPerRound),
                 {});
    tbb::parallel_for(std::size_t{0}, round.size(), [&](std::size_t i) {
      round[i] = trace(traced.emitted_paths + i * kPathsPerBatch, kPathsPerBatch);
    });
    for (Batch& batch : round) {
      const std::uint64_t wanted = options.photon_count - stored;
      if (batch.photon_count() >= wanted) {
        // Trace the batch again up to the path that reaches the count.
        const auto last = std::ranges::lower_bound(batch.stored_until, wanted);
        batch = trace(traced.emitted_paths, last - batch.stored_until.begin() + 1);
      }
      Append(traced, batch);
      stored += batch.photon_count();
      if (stored >= options.photon_count) break;
    }
    if (options.progress) options.progress(stored);
    const auto expected = static_cast<double>(traced.emitted_paths) * kMinPhotonsPerPath;
    if (traced.emitted_paths > 1'000'000 && static_cast<double>(stored) < expected) {
      return absl::FailedPreconditionError(
          fmt::format("the light does not reach diffuse surfaces: {} photons stored of {} paths",
                      stored, traced.emitted_paths));
    }
  }
  DividePower(traced);
  return traced;
}

}  // namespace treelight::client
