#ifndef TREELIGHT_CORE_GATHERER_H_
#define TREELIGHT_CORE_GATHERER_H_

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "core/model/tree.h"

namespace treelight {

/// Polled between launches of long work, or by several threads at once; true means "stop": the work
/// then returns CANCELLED. Empty means never.
using CancelCheck = std::function<bool()>;

/// Weight of a photon at distance d of a gather of radius R, each normalised over the disc of
/// radius R.
enum class DensityKernel : std::uint32_t {
  kConstant = kKernelConstant,          ///< 1 / (pi R^2)
  kCone = kKernelCone,                  ///< 3 (1 - d/R) / (pi R^2)
  kEpanechnikov = kKernelEpanechnikov,  ///< 2 (1 - d^2/R^2) / (pi R^2)
};

/// Most photons that one stands for.
inline constexpr std::uint32_t kMaxMergedPhotons = 64;

/// What an answer may give up for speed. Zeros: nothing, the answer is exact.
struct Approximation {
  /// (1 + epsilon)-nearest neighbours (Arya et al. 1998), where k > 0: each distance that is
  /// returned is at most 1 + epsilon times the true one of its rank; which photons count as found,
  /// and how many, stays exact where there are less than k within the radius. >= 0, finite.
  float epsilon = 0;
  /// Leaves whose photons a query compares at most, where k > 0, the nearest first; leaves that
  /// hold few photons together may count as one (blocks of kBlockSize). 0: no limit.
  std::uint32_t max_leaves = 0;
  /// Where k is 0, of densities without normals: a subtree that lies within the radius whole is
  /// added up at once, by the moments of its powers, where that changes the weight of no photon by
  /// more than this times the largest weight of the kernel. It changes none but of the cone, since
  /// the other kernels are lines in the squared distance. Counts stay exact. [0, 1]. 0: photon by
  /// photon.
  float weight_tolerance = 0;
  /// Of densities: gathers from a map in which up to so many photons, 2, 4, 8 ... 64, are merged to
  /// one (core/merged_gather.h). A Gatherer by itself has none and answers exactly. 0: none are
  /// merged.
  std::uint32_t merged_photons = 0;
  /// Of densities, instead of all of the above: the largest root mean square over the batch of
  /// |density / exact density - 1|, of the sum of the channels, that may be taken for speed; as
  /// merged_photons, with the group size chosen by a sample of the batch. [0, 1). 0: exact.
  float max_relative_error = 0;
  /// As merged_photons, from a random subset of the photons: one of so many, 2, 4, 8 ... 64, with
  /// the power of those that go (model/thin_photons.h). 0: all stay.
  std::uint32_t thinned_photons = 0;

  /// Whether a Gatherer may give an answer that differs from the exact one, which it bounds.
  bool any() const { return epsilon > 0 || max_leaves > 0 || weight_tolerance > 0; }
  /// Whether an answer may be gathered from fewer photons.
  bool merges() const {
    return merged_photons > 0 || thinned_photons > 0 || max_relative_error > 0;
  }
  /// (1 + epsilon)^2, rounded down: a box whose squared distance, times this, is above that of the
  /// k-th candidate need not be entered.
  float squared_stretch() const;
  friend bool operator==(const Approximation&, const Approximation&) = default;
};

/// What to gather around each query.
struct GatherOptions {
  /// Neighbours kept: the k with the smallest (squared distance, photon index). 0 means all within
  /// `radius`, which must then be finite. At most kMaxNeighbors.
  std::uint32_t k = 0;
  float radius =
      std::numeric_limits<float>::infinity();  ///< r, scene units, >= 0; within means d2 <= r*r
  std::uint32_t outputs = kOutputCount;        ///< mask of kOutput bits, not 0
  DensityKernel kernel = DensityKernel::kEpanechnikov;
  Approximation approximation{};
  /// Neighbours in the lists of the whole batch, at most; counted before they are listed.
  std::uint64_t max_neighbors = std::numeric_limits<std::uint64_t>::max();
};

/// Largest k of a gather.
inline constexpr std::uint32_t kMaxNeighbors = 4096;

/// Queries of one batch; the caller keeps the arrays alive. m is positions.size() / 3.
struct GatherQueries {
  std::span<const float> positions = {};  ///< [3m] scene units, finite, within kMaxCoordinate
  /// [3m] or empty; DENSITY then leaves out photons with direction . normal >= 0
  std::span<const float> normals = {};
  std::span<const float> radii = {};  ///< [m] or empty; instead of GatherOptions::radius

  std::size_t size() const { return positions.size() / 3; }
};

/// Where the time of a call went, microseconds.
struct GatherTimes {
  double upload_us = 0;
  double kernel_us = 0;
  double download_us = 0;

  GatherTimes& operator+=(const GatherTimes& more) {
    upload_us += more.upload_us;
    kernel_us += more.kernel_us;
    download_us += more.download_us;
    return *this;
  }
};

/// Answers of a batch of m queries; an array that was not asked for is empty.
struct GatherResult {
  std::vector<std::uint32_t> counts;  ///< [m] photons found, at most k where k > 0
  /// [m] distance of the k-th photon where k were found, else r (which may be +inf), scene units
  std::vector<float> radii;
  /// [m * k] where k > 0: nearest first, padded with kNoPhoton and +inf. Where k is 0: the lists of
  /// all queries one after the other; list i is [neighbor_offsets[i], neighbor_offsets[i + 1]).
  std::vector<std::uint32_t> neighbor_ids;
  std::vector<float> neighbor_squared_distances;
  std::vector<std::uint64_t> neighbor_offsets;  ///< [m + 1] where k is 0, else empty
  /// [3m] sum of power * kernel(d / R), R as in `radii`, W / unit^2, RGB; 0 where R * R, rounded to
  /// float, is 0 or infinite
  std::vector<float> densities;
  std::vector<std::uint32_t>
      nodes_visited;  ///< [m] inner nodes + leaves whose content was examined
  std::vector<std::uint32_t> distance_tests;  ///< [m] photons compared
  /// [m] where GatherOptions::approximation asks for one, with kOutputErrorBound and without; else
  /// empty: what is known of the error of
  /// each query. Where k is 0: no channel of the density is farther from the exact one, W / unit^2,
  /// roundings apart. Else distances, of each rank, are at most 1 + bound times the true ones, as
  /// float32 computes them; 0: all distances, and how many there are, are exact, and of several
  /// photons at the k-th distance any may be there; +inf: nothing is known, mostly since less than
  /// k were found and there may be more.
  std::vector<float> error_bounds;
  /// [m] where it was gathered from fewer photons (core/merged_gather.h), else empty: 1 where the
  /// answer is made of those, 0 where it is exact.
  std::vector<std::uint8_t> merged;
  std::string_view search;  ///< which search was taken, and why, for people; static text
  GatherTimes times;
};

/// Time of one stage of a build.
struct StageTime {
  std::string stage;  ///< "upload", "bounds", "morton", "sort", "levels", "ties", "leaves",
                      ///< "permute", "hierarchy", "statistics", "wide" (on devices with
                      ///< sub-groups)
  double microseconds = 0;
};

/// How a map was built.
struct BuildReport {
  std::string builder;             ///< "lbvh", "brute_force"
  std::string device;              ///< name of the device that holds the map
  std::uint64_t device_bytes = 0;  ///< held while the map lives
  std::vector<StageTime> stages;   ///< in the order in which they ran
  /// Gather radius of the options, else the one that was sampled, scene units; 0: neither.
  float radius = 0;
  TreeStatistics tree;  ///< zeros for brute force
};

/// Bound of GatherResult::error_bounds for the k nearest photons of one query.
/// @param full      k were found, the farthest at squared distance `farthest`
/// @param given_up  squared distance of the nearest subtree that was left out and might have held
///                  one of the k; +inf: none
float NearestErrorBound(bool full, float farthest, float given_up);

/// A photon map that answers gathers. Immutable; safe to call from several threads at once.
class Gatherer {
 public:
  virtual ~Gatherer() = default;

  /// Answers every query, exactly unless GatherOptions::approximation says otherwise. Blocks until
  /// the answers are here. INVALID_ARGUMENT: k and radius both unlimited, k over kMaxNeighbors,
  /// outputs 0 or unknown, arrays of unequal length, an approximation that is not possible, DENSITY
  /// of a map without powers, normals for a map without directions. RESOURCE_EXHAUSTED: the answer
  /// or its work space does not fit the device. CANCELLED: `cancelled` said so.
  virtual absl::StatusOr<GatherResult> Gather(const GatherQueries& queries,
                                              const GatherOptions& options,
                                              const CancelCheck& cancelled = {}) const = 0;

  /// Copies the tree to the host, for validation and statistics. UNIMPLEMENTED where there is none.
  virtual absl::StatusOr<Tree> ReadTree() const = 0;

  /// Copies the photons to the host, in the order of upload, to build another map from. Blocks. As
  /// they were uploaded, but for coordinates of -0, which may come back as +0.
  virtual absl::StatusOr<Photons> ReadPhotons() const = 0;

  virtual std::size_t photon_count() const = 0;
  virtual bool has_powers() const = 0;
  virtual bool has_directions() const = 0;
  virtual const BuildReport& report() const = 0;
};

/// RESOURCE_EXHAUSTED where the lists of a batch hold more than `options` allows.
absl::Status CheckNeighborCount(std::uint64_t neighbor_count, const GatherOptions& options);

/// The checks that every Gatherer makes before it works; see Gatherer::Gather.
absl::Status CheckGather(const Gatherer& map, const GatherQueries& queries,
                         const GatherOptions& options);

}  // namespace treelight

#endif  // TREELIGHT_CORE_GATHERER_H_
