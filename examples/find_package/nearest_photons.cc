// Builds a photon map on a treelightd, and another one on a device of this process, gathers
// around the same points, and compares the answers with those of brute force.
//
//   nearest_photons [SERVER]      127.0.0.1:7543 without it
//
// Exit codes: 0 the answers agree; 1 they differ, or a call failed.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "client/photon_map_client.h"
#include "core/builder.h"

namespace {

using treelight::GatherResult;
using treelight::Photons;

constexpr std::size_t kPhotonCount = 50'000;
constexpr std::size_t kQueryCount = 1'000;

/// `count` numbers of [first, last).
std::vector<float> RandomNumbers(std::size_t count, float first, float last, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> draw(first, last);
  std::vector<float> numbers(count);
  for (float& number : numbers) number = draw(random);
  return numbers;
}

/// Photons in the unit cube.
Photons MakePhotons() {
  return {.positions = RandomNumbers(3 * kPhotonCount, 0, 1, /*seed=*/1),
          .powers = RandomNumbers(3 * kPhotonCount, 0, 0.001f, /*seed=*/2),
          .directions = {}};
}

/// Largest difference of two arrays of densities, relative to the larger number.
float LargestDifference(const std::vector<float>& a, const std::vector<float>& b) {
  float largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const float scale = std::max(std::abs(a[i]), std::abs(b[i]));
    if (scale > 0) largest = std::max(largest, std::abs(a[i] - b[i]) / scale);
  }
  return largest;
}

/// What a server answers: uploads, gathers, deletes.
absl::StatusOr<GatherResult> AskServer(const std::string& address, const Photons& photons,
                                       const treelight::GatherQueries& queries,
                                       const treelight::GatherOptions& options) {
  treelight::client::PhotonMapClient client(address);
  const auto built = client.BuildPhotonMap("nearest_photons", photons);
  if (!built.ok()) return built.status();
  std::printf("%zu photons on %s: %u nodes, depth %u, %.1f ms\n", kPhotonCount,
              built->map().device().c_str(), built->map().statistics().node_count(),
              built->map().statistics().depth(), built->timings().kernel_us() / 1000);

  const treelight::client::MapRef map{built->map().name(), built->map().version()};
  auto answer = client.Gather(map, queries, options);
  const auto deleted = client.DeletePhotonMap(map);
  if (!answer.ok()) return answer.status();
  if (!deleted.ok()) return deleted.status();
  return std::move(answer->result);
}

/// What a map answers that `builder` builds in this process.
absl::StatusOr<GatherResult> Compute(absl::StatusOr<std::unique_ptr<treelight::Builder>> builder,
                                     const Photons& photons,
                                     const treelight::GatherQueries& queries,
                                     const treelight::GatherOptions& options) {
  if (!builder.ok()) return builder.status();
  const auto map = (*builder)->Build(photons, {});
  if (!map.ok()) return map.status();
  return (*map)->Gather(queries, options);
}

/// Prints whether `answer` is `expected`, and returns it. Counts, neighbours and distances must be
/// the same bits, ties included; densities are float sums.
bool Agree(const char* who, const absl::StatusOr<GatherResult>& answer,
           const GatherResult& expected) {
  if (!answer.ok()) {
    std::fprintf(stderr, "nearest_photons: %s: %s\n", who, answer.status().ToString().c_str());
    return false;
  }
  const bool same = answer->counts == expected.counts &&
                    answer->neighbor_ids == expected.neighbor_ids &&
                    answer->neighbor_squared_distances == expected.neighbor_squared_distances;
  const float difference = LargestDifference(answer->densities, expected.densities);
  std::printf("%-12s neighbours %s, densities within %.1g\n", who, same ? "agree" : "DIFFER",
              difference);
  return same && difference < 1e-5f;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string address = argc > 1 ? argv[1] : "127.0.0.1:7543";
  const Photons photons = MakePhotons();
  const std::vector<float> points = RandomNumbers(3 * kQueryCount, 0, 1, /*seed=*/3);
  const treelight::GatherQueries queries{.positions = points};
  const treelight::GatherOptions options{
      .k = 20,
      .radius = 0.05f,
      .outputs = treelight::kOutputCount | treelight::kOutputNeighbors | treelight::kOutputDensity};

  const auto expected = Compute(treelight::MakeBruteForceBuilder(), photons, queries, options);
  if (!expected.ok()) {
    std::fprintf(stderr, "nearest_photons: %s\n", expected.status().ToString().c_str());
    return 1;
  }
  const bool server_agrees =
      Agree("server", AskServer(address, photons, queries, options), *expected);
  const bool device_agrees =
      Agree("this process", Compute(treelight::MakeDeviceBuilder(), photons, queries, options),
            *expected);
  return server_agrees && device_agrees ? 0 : 1;
}
