#ifndef TREELIGHT_TESTS_TRACED_PHOTONS_H_
#define TREELIGHT_TESTS_TRACED_PHOTONS_H_

#include <utility>

#include "client/scenes/vector.h"
#include "client/trace/photon_tracer.h"
#include "core/model/octahedral.h"
#include "gtest/gtest.h"
#include "tests/test_scenes.h"

namespace treelight::testing {

/// The photons of a scene that must have some.
inline client::TracedPhotons MustTrace(const client::Scene& scene,
                                       const client::PhotonTraceOptions& options) {
  auto photons = client::TracePhotons(MustIntersect(scene), options);
  EXPECT_TRUE(photons.ok()) << photons.status();
  return *std::move(photons);
}

/// The unit direction of photon `i`.
inline Vec3 DirectionOf(const Photons& photons, std::size_t i) {
  return client::Normalize(
      DecodeOctahedral(photons.directions[2 * i], photons.directions[2 * i + 1]));
}

/// Everything that took power, less what came.
inline client::Power Imbalance(const client::EnergyBalance& energy) {
  client::Power sum{};
  for (int c = 0; c < 3; ++c) {
    sum[c] = energy.absorbed_diffuse[c] + energy.absorbed_elsewhere[c] + energy.escaped[c] +
             energy.shading[c] + energy.roulette[c] + energy.cut[c] - energy.emitted[c];
  }
  return sum;
}

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_TRACED_PHOTONS_H_
