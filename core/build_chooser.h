#ifndef TREELIGHT_CORE_BUILD_CHOOSER_H_
#define TREELIGHT_CORE_BUILD_CHOOSER_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/build_costs.h"
#include "core/builder.h"
#include "core/measured_costs.h"

namespace treelight {

/// What a tree is chosen for, and what is not to be chosen.
struct AutoBuild {
  /// Gathers that the map will answer; 0: as many as it has photons.
  std::uint64_t expected_gathers = 0;
  std::uint32_t expected_k = 50;            ///< of them; 0: all within a radius
  std::uint32_t max_leaf_size = 0;          ///< B; 0: chosen too
  std::optional<MortonBits> morton_bits{};  ///< chosen too where empty

  friend bool operator==(const AutoBuild&, const AutoBuild&) = default;
};

/// Options, and why they were taken.
struct BuildChoice {
  BuildOptions options;
  std::string reason;  ///< a sentence for people
};

/// Parts of the photons, [0, 1], that share a cell of Morton codes with several times as many as a
/// leaf holds.
struct SharedCells {
  double of_30_bits = 0;
  double of_63_bits = 0;
};

/// Counts in a sample of 16 384 of `positions` [3n], or all of them where they are less.
SharedCells CountSharedCells(const std::vector<float>& positions, std::uint32_t max_leaf_size);

/// The candidate by which the build and the expected gathers take the least time, with the codes by
/// which the build does. Where two are equal, the earlier one of kTreeCandidates.
/// @param options  what the choice leaves as it is
BuildChoice ChooseBuild(const BuildCosts& costs, const SharedCells& shared,
                        std::uint64_t photon_count, const AutoBuild& asked, BuildOptions options);

/// Of what ChooseBuild may choose, the options that take the most memory to build.
BuildOptions LargestBuild(const AutoBuild& asked, BuildOptions options);

/// Chooses trees for the photons at hand by what builds and gathers cost on a device, which it
/// measures once for each order of magnitude of k, when it is first asked. Safe to call from
/// several threads at once, which may then measure more than once; others that use the device
/// meanwhile are measured too.
class BuildChooser {
 public:
  /// @param builder  outlives this object
  explicit BuildChooser(Builder& builder) : builder_(builder) {}

  /// See ChooseBuild and MeasureBuildCosts, whose errors it has.
  absl::StatusOr<BuildChoice> Choose(const Photons& photons, const AutoBuild& asked,
                                     const BuildOptions& options,
                                     const CancelCheck& cancelled = {});

  /// Host memory that the measurement takes for such gathers, bytes; 0 once it is made.
  std::uint64_t WorkBytes(const AutoBuild& asked) const;

 private:
  Builder& builder_;
  MeasuredCosts<std::uint32_t, BuildCosts> costs_;  // by k, see MeasuredK
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_BUILD_CHOOSER_H_
