#ifndef TREELIGHT_TESTS_MAP_PAIR_H_
#define TREELIGHT_TESTS_MAP_PAIR_H_

#include <memory>

#include "core/builder.h"
#include "core/gatherer.h"
#include "gtest/gtest.h"
#include "tests/test_device.h"

namespace treelight {

/// The same photons twice: on the test device, and by brute force.
struct MapPair {
  std::unique_ptr<Gatherer> device, brute_force;
};

inline MapPair BuildPair(const Photons& photons, const BuildOptions& options = {}) {
  auto device = TestBuilder().Build(photons, options);
  auto brute_force = MakeBruteForceBuilder()->Build(photons, {});
  EXPECT_TRUE(device.ok()) << device.status();
  EXPECT_TRUE(brute_force.ok()) << brute_force.status();
  return {*std::move(device), *std::move(brute_force)};
}

}  // namespace treelight

#endif  // TREELIGHT_TESTS_MAP_PAIR_H_
