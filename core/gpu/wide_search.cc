#include "core/gpu/wide_search.h"

#include <algorithm>

namespace treelight {
namespace {

constexpr std::size_t kWideGroup = kSubGroupSize * kSubGroupsPerGroup;

/// Of so few queries neighbours have little in common, and too few sub-groups are at work where
/// each has several: measured with 1e5 to 1e7 photons, k 50 and counts.
bool AreFew(std::size_t queries, std::size_t photons) { return queries <= 16384 + photons / 64; }

/// Places of a list of gather_long, which gathers at most all of the map's photons. A quarter more
/// than are kept, so that most lists are cut once, at the end; of large k less, so that a list fits
/// the local memory that every GPU with sub-groups of 32 has.
std::size_t LongListSize(std::size_t k, std::size_t photon_count) {
  constexpr std::size_t kMost = (48 * 1024 - 1024) / sizeof(cl_ulong);
  static_assert(kMaxNeighbors + 96 <= kMost && kMost % kSubGroupSize == 0);
  const std::size_t kept = std::min(k, photon_count);
  return std::min((kept + kept / 4 + 96) / kSubGroupSize * kSubGroupSize, kMost);
}

}  // namespace

/// Calls `launch(part, program, items)` for the parts of the batch, with the program that is fast
/// for as many queries.
template <typename LaunchPart>
void WideSearch::InParts(const WidePrograms& programs, const WideVariants& variants,
                         LaunchPart&& launch) const {
  PacedLaunches(map.gpu, pace, params, count, QueriesPerLaunch(map.gpu), cancelled,
                [&](const GatherParams& part) {
                  const bool few = AreFew(part.count, map.photon_count);
                  const std::size_t queries = (few ? variants.few : variants.many).queries;
                  launch(part, few ? programs.few : programs.many,
                         (part.count + queries - 1) / queries * kSubGroupSize);
                });
}

void WideSearch::GatherWide() const {
  InParts(map.gpu.gather_wide, kGatherWideVariants,
          [&](const GatherParams& part, const cl::Program& program, std::size_t items) {
            Launch(map.gpu, program, "gather_wide", items, kWideGroup, map.wide.boxes.get(),
                   map.wide.shape, map.wide.sizes.get(), map.tree.photons.get(), map.powers.get(),
                   batch.positions.get(), batch.order.get(), batch.radii_in.get(),
                   batch.normals.get(), part, batch.counts.get(), batch.radii.get(),
                   batch.neighbor_ids.get(), batch.neighbor_d2.get(), batch.densities.get());
          });
}

void WideSearch::GatherLong() const {
  const std::size_t list_size = LongListSize(params.k, map.photon_count);
  // A multiprocessor holds so many groups at most that two short lists to a group are better.
  const bool pairs = list_size <= kLongPairPlaces;
  const std::size_t lists = pairs ? 2 : 1;
  PacedLaunches(
      map.gpu, pace, params, count, QueriesPerLaunch(map.gpu), cancelled,
      [&](const GatherParams& part) {
        Launch(map.gpu, pairs ? map.gpu.gather_long_pairs : map.gpu.gather_long, "gather_long",
               part.count * kSubGroupSize, lists * kSubGroupSize, map.wide.boxes.get(),
               map.wide.shape, map.wide.sizes.get(), map.tree.photons.get(), map.powers.get(),
               batch.positions.get(), batch.order.get(), batch.radii_in.get(), batch.normals.get(),
               part, batch.counts.get(), batch.radii.get(), batch.neighbor_ids.get(),
               batch.neighbor_d2.get(), batch.densities.get(), static_cast<cl_uint>(list_size),
               cl::Local(lists * list_size * sizeof(cl_ulong)));
      });
}

void WideSearch::CountWide() const {
  InParts(map.gpu.count_wide, kCountWideVariants,
          [&](const GatherParams& part, const cl::Program& program, std::size_t items) {
            Launch(map.gpu, program, "count_wide", items, kWideGroup, map.wide.boxes.get(),
                   map.wide.shape, map.wide.sizes.get(), map.tree.photons.get(),
                   batch.positions.get(), batch.order.get(), batch.radii_in.get(), part,
                   batch.counts.get(), batch.radii.get());
          });
}

void WideSearch::DensityWide() const {
  InParts(map.gpu.density_wide, kDensityWideVariants,
          [&](const GatherParams& part, const cl::Program& program, std::size_t items) {
            Launch(map.gpu, program, "density_wide", items, kWideGroup, map.wide.boxes.get(),
                   map.wide.shape, map.wide.sizes.get(), map.tree.photons.get(), map.powers.get(),
                   batch.positions.get(), batch.order.get(), batch.radii_in.get(),
                   batch.normals.get(), part, batch.counts.get(), batch.radii.get(),
                   batch.densities.get());
          });
}

}  // namespace treelight
