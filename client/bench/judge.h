#ifndef TREELIGHT_CLIENT_BENCH_JUDGE_H_
#define TREELIGHT_CLIENT_BENCH_JUDGE_H_

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/gatherer.h"
#include "core/model/photons.h"

namespace treelight {

/// Queries whose answers are checked.
inline constexpr std::size_t kCheckedQueries = 256;

/// Knows the right answers to some queries, by brute force in double. Safe to call from several
/// threads at once.
class Judge {
 public:
  /// Compares each query with every photon, by TBB in the arena of the caller.
  /// @param photons  stays where it is
  /// @param queries  [3m] scene units
  /// @param max_k, max_radius  the largest that will be judged; a radius without a limit does not
  ///   count
  Judge(const Photons& photons, std::vector<float> queries, std::uint32_t max_k, float max_radius);

  /// What is wrong with the answers to a batch, counts, neighbours and densities where they are
  /// there; empty: nothing. A distance may be off by the rounding of float, and so may a count at
  /// the very radius; no photon may be in a list twice; a density by 1e-4 of itself. Lists are
  /// judged together with their counts.
  /// @param places  [m] which query of the batch is query i of the judge
  std::string WhatIsWrong(const GatherOptions& search, const GatherResult& found,
                          std::span<const std::size_t> places) const;

  const std::vector<float>& queries() const { return queries_; }  ///< [3m]

 private:
  struct Photon {
    double squared_distance;
    std::uint32_t id;
  };

  std::vector<Photon> FindNearest(const float* query, std::uint32_t max_k, float max_radius) const;
  std::uint32_t Count(std::size_t check, double squared_radius) const;
  double SquaredDistance(const float* query, std::uint32_t id) const;
  std::string JudgeCount(std::size_t check, const GatherOptions& search, std::uint32_t count) const;
  std::string JudgeList(std::size_t check, std::span<const std::uint32_t> ids,
                        std::span<const float> squared_distances) const;
  std::string JudgeDensity(std::size_t check, const GatherOptions& search,
                           std::span<const float> density) const;

  const Photons& photons_;
  const std::vector<float> queries_;
  std::vector<std::vector<Photon>> truth_;  // of each query, nearest first
};

/// Where `count` queries lie that are spread over a batch of `query_count`, at least as many.
std::vector<std::size_t> SpreadPlaces(std::size_t query_count, std::size_t count = kCheckedQueries);

/// Where each of `queries` [3m] lies in `batch`, which has it.
std::vector<std::size_t> FindPlaces(std::span<const float> queries, std::span<const float> batch);

}  // namespace treelight

#endif  // TREELIGHT_CLIENT_BENCH_JUDGE_H_
