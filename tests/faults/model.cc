#include "tests/faults/model.h"

#include <random>

#include "core/builder.h"

namespace treelight::faults {
namespace {

constexpr std::uint32_t kCells = 32;

float OnGrid(std::mt19937& engine) {
  return static_cast<float>(engine() % (kCells + 1)) / static_cast<float>(kCells);
}

}  // namespace

Photons MakePhotons(const PhotonSet& set) {
  std::mt19937 engine(set.seed);
  Photons photons;
  photons.positions.resize(std::size_t{3} * set.count);
  for (float& coordinate : photons.positions) coordinate = OnGrid(engine);
  // Every other set has powers, so that files hold several arrays.
  if (set.seed % 2 == 0) {
    photons.powers.resize(std::size_t{3} * set.count);
    for (float& power : photons.powers) power = OnGrid(engine);
  }
  return photons;
}

std::vector<float> MakeQueries(const QuerySet& set) {
  std::mt19937 engine(set.seed);
  std::uniform_real_distribution<float> anywhere(0, 1);
  std::vector<float> positions(std::size_t{3} * set.count);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    positions[i] = i / 3 % 2 == 0 ? OnGrid(engine) : anywhere(engine);
  }
  return positions;
}

GatherOptions MakeOptions(const QuerySet& set) {
  return {
      .k = set.k, .radius = set.radius, .outputs = kOutputCount | kOutputRadius | kOutputNeighbors};
}

std::unique_ptr<const Gatherer> MakeBruteForce(const PhotonSet& set) {
  return *MakeBruteForceBuilder()->Build(MakePhotons(set), {});
}

bool IsAnswer(const Gatherer& photons, const QuerySet& queries, const GatherResult& result) {
  const auto positions = MakeQueries(queries);
  const auto expected = photons.Gather({.positions = positions}, MakeOptions(queries));
  // No answer has a NaN: what is equal is the same.
  return expected.ok() && expected->counts == result.counts && expected->radii == result.radii &&
         expected->neighbor_ids == result.neighbor_ids &&
         expected->neighbor_squared_distances == result.neighbor_squared_distances &&
         expected->neighbor_offsets == result.neighbor_offsets;
}

}  // namespace treelight::faults
