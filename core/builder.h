#ifndef TREELIGHT_CORE_BUILDER_H_
#define TREELIGHT_CORE_BUILDER_H_

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/gatherer.h"
#include "core/model/heuristic.h"

namespace treelight {

/// How a tree is built.
enum class BuilderKind {
  kLbvh,      ///< Karras 2012: Morton order, with runs of equal codes rebuilt by position
  kTreelet,   ///< lbvh, its treelets restructured as a k-d tree (Bulavintsev and Zhdanov 2020)
  kHybrid,    ///< lbvh on top, every maximal subtree of at most T photons rebuilt by a sweep
  kTrbvh,     ///< lbvh, its treelets restructured as a BVH (Karras and Aila 2013)
  kAtrbvh,    ///< as kTrbvh, by agglomeration (Domingues and Pedrini 2015)
  kBalanced,  ///< top-down: median of the widest axis
  kSweep,  ///< top-down: the cut of least cost by the heuristic: `sah`, `isa` and `vvh` of the docs
  kKarras,  ///< Karras 2012 as he has it: a grid with as many cells along each axis, runs of equal
            ///< codes split by place, so that siblings may overlap; what the study measures against
};

/// Bits of the Morton codes: 10 or 21 per axis.
enum class MortonBits : std::uint32_t { k30 = 30, k63 = 63 };

struct BuildOptions {
  BuilderKind builder = BuilderKind::kLbvh;
  MortonBits morton_bits = MortonBits::k30;  ///< of lbvh, and of the lbvh that others start from
  std::uint32_t max_leaf_size = 16;          ///< B, photons, [1, kMaxLeafSize]
  Heuristic heuristic = Heuristic::kIsa;     ///< of treelets, hybrid and sweep
  LeafTerm leaf_term = LeafTerm::kLeafSize;  ///< of the same, and of balanced
  std::uint32_t treelet_size = 7;  ///< leaves of a treelet: treelet [3, 16], trbvh [3, 9], atrbvh
                                   ///< [3, 32]
  std::uint32_t rounds = 3;        ///< of restructuring, [1, 8]
  float radius = 0;  ///< gather radius that isa and vvh expect, and that TreeStatistics::isa_cost
                     ///< is told for, scene units, finite; 0: sampled by builders that need one
  std::uint32_t subtree_size = 256;  ///< T, photons of a subtree that hybrid rebuilds, [B, 4096]
  std::uint32_t seed = 0;            ///< of the photons that the radius is sampled at
};

/// Largest B.
inline constexpr std::uint32_t kMaxLeafSize = 64;

/// Most rounds.
inline constexpr std::uint32_t kMaxRounds = 8;

/// Largest T.
inline constexpr std::uint32_t kMaxSubtreeSize = 4096;

/// Below this B the nodes of a subtree take so much local memory that the device rebuilds half as
/// much.
inline constexpr std::uint32_t kManyNodesLeafSize = 8;

/// Largest T that the device rebuilds.
constexpr std::uint32_t MaxDeviceSubtree(std::uint32_t max_leaf_size) {
  return max_leaf_size < kManyNodesLeafSize ? 512 : 1024;
}

/// Largest treelet of atrbvh that the device restructures; of the others kMaxSearchedTreelet.
inline constexpr std::uint32_t kMaxDeviceAgglomeration = 16;

/// Makes photon maps. Safe to call from several threads at once.
class Builder {
 public:
  virtual ~Builder() = default;

  /// Builds a map over `photons` and blocks until it can answer. No photons is a map too: its
  /// answers are empty. INVALID_ARGUMENT: arrays of unequal length, a coordinate that is not finite
  /// or beyond kMaxCoordinate, an option out of range; the message names field, index and value.
  /// RESOURCE_EXHAUSTED: larger than one device buffer or the device's memory; the message names
  /// the limit. CANCELLED: `cancelled` said so. INTERNAL: the device failed.
  virtual absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                          const BuildOptions& options,
                                                          const CancelCheck& cancelled = {}) = 0;

  /// Host memory that building a tree of so many photons takes, beside the photons and the map,
  /// bytes, a little more rather than less. 0 where the device has memory of its own for it.
  virtual std::uint64_t WorkBytes(const BuildOptions& options, std::uint64_t photon_count) const;
};

/// The name of a tree of these options: "lbvh", "treelet", "hybrid", "trbvh", "atrbvh", "balanced",
/// "karras"; of kSweep the heuristic's: "sah", "isa", "vvh".
std::string BuilderName(const BuildOptions& options);

/// The name of a heuristic: "sah", "isa", "vvh".
std::string HeuristicName(Heuristic heuristic);

/// Whether siblings of its trees may overlap.
TreeKind KindOfTree(BuilderKind builder);

/// Whether a builder reads morton_bits, heuristic, leaf_term, and treelet_size with rounds.
bool ReadsMortonBits(BuilderKind builder);
bool ReadsHeuristic(BuilderKind builder);
bool ReadsLeafTerm(BuilderKind builder);
bool ReadsTreelets(BuilderKind builder);

/// Whether a device builder has the stages of this tree, else it is built on the CPU and copied: of
/// lbvh, of treelets that one work-group can search, of hybrid with T <= MaxDeviceSubtree.
bool HasDeviceStages(const BuildOptions& options);

/// The part of CheckBuild that needs no photons.
absl::Status CheckBuildOptions(const BuildOptions& options);

/// The checks that every Builder makes before it works; see Builder::Build.
absl::Status CheckBuild(const Photons& photons, const BuildOptions& options);

/// Platform of the CPU that TBB and vector instructions use without OpenCL.
inline constexpr char kNativePlatform[] = "native";

/// One device of this machine: a device of OpenCL, or its CPU as TBB uses it.
struct DeviceInfo {
  int index = 0;  ///< what `--device` takes; GPUs first, then kNativePlatform, then other CPUs
  std::string name, platform, driver;
  std::string type;  ///< "gpu", "cpu" or "other"
  std::uint32_t compute_units = 0;
  std::uint64_t memory_bytes = 0;
  std::uint64_t max_buffer_bytes = 0;
};

/// The devices of this machine in the order of their index.
std::vector<DeviceInfo> ListDevices();

struct DeviceOptions {
  /// Empty: the first one; else an index, or part of a name, case ignored; or several of them,
  /// separated by commas, GPUs that are equally fast.
  std::string device;
  std::string
      cache_directory;  ///< compiled kernels; empty: $XDG_CACHE_HOME or ~/.cache, then "treelight"
};

/// A builder on a device: MakeCpuBuilder on kNativePlatform, else one of OpenCL, its kernels
/// compiled; trees that an OpenCL device has no stage for are built on the CPU and copied. All give
/// the same trees and the same answers, bit for bit. NOT_FOUND: no such device; the message lists
/// those there are. INVALID_ARGUMENT: of several one is named twice, or is no GPU. On several, see
/// MakeReplicatedBuilder.
absl::StatusOr<std::unique_ptr<Builder>> MakeDeviceBuilder(const DeviceOptions& options = {});

/// The device that a MakeDeviceBuilder with the same options takes. Of several the index of the
/// first, all names, and the memory of the one that has the least.
absl::StatusOr<DeviceInfo> ChooseDevice(const DeviceOptions& options = {});

/// All kinds of trees on the CPU, by TBB in the arena of the caller: the same tree for any number
/// of threads. What other devices are checked against. Gathers use the widest vector instructions
/// that this processor has.
/// @param device_name  for BuildReport::device
std::unique_ptr<Builder> MakeCpuBuilder(std::string device_name = "cpu");

/// The plain reference on the CPU: compares every query with every photon, in float32 as the
/// devices do.
std::unique_ptr<Builder> MakeBruteForceBuilder();

}  // namespace treelight

#endif  // TREELIGHT_CORE_BUILDER_H_
