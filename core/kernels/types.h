/* Structures and constants that the host and the OpenCL kernels share. Compiled by both: scalars
 * only. */
#ifndef TREELIGHT_CORE_KERNELS_TYPES_H_
#define TREELIGHT_CORE_KERNELS_TYPES_H_

#ifndef __OPENCL_C_VERSION__
#include <cstdint>
namespace treelight {
using uint = std::uint32_t;
using ulong = std::uint64_t;
#define TREELIGHT_SHARED inline constexpr uint
#else
#define TREELIGHT_SHARED constant uint
#endif

/** A child link with this bit is a leaf, the other bits are its first photon in leaf order; without
 * it the link is the index of a node. */
TREELIGHT_SHARED kLeafBit = 0x80000000u;

/** Marks "no photon" in padded neighbour lists. */
TREELIGHT_SHARED kNoPhoton = 0xffffffffu;

/** Deepest path from the root that a tree may have, in edges; the traversal stack has as many
 * places. */
enum { kMaxDepth = 128 }; /* an enumerator, to be the length of an array in both languages */

/** Inner node of the tree: the tight boxes of both children, so that one read decides which to
 * visit. Node i separates leaf i from leaf i + 1 in leaf order (Apetrei 2014 numbers nodes this
 * way). 64 bytes; the smallest photon index below each child, needed for ties alone, lies apart. */
typedef struct Node {
  float left_min[3], left_max[3], right_min[3], right_max[3]; /**< scene units */
  uint left, right;             /**< child: index of a node, or kLeafBit | first photon */
  uint left_count, right_count; /**< photons below each child */
} Node;

/** Where the tree begins, and what holds all of it: the entry of every traversal. */
typedef struct Root {
  float min[3], max[3]; /**< tight box of all photons, scene units */
  uint link;            /**< as a child link; undefined where count is 0 */
  uint count;           /**< photons */
  uint depth;           /**< edges from the root to the deepest leaf */
} Root;

/** Work-groups that sum over a tree, the same on every device, so that sums of floats have the same
 * bits. */
enum { kTreeSumGroups = 256 };

/** What is read back of a tree: its root, and the parts of its sums. */
typedef struct TreeSums {
  ulong depths[kTreeSumGroups];      /**< of the leaves, edges from the root */
  float areas[kTreeSumGroups];       /**< half the surface areas of all children, in units that
                                      * area_scale of statistics.cl gives */
  float grown_areas[kTreeSumGroups]; /**< the same of boxes grown by the gather radius */
  uint blocks[kTreeSumGroups];       /**< of the wide tree */
  Root root;
} TreeSums;

/** Photon in leaf order: position in scene units, index in the order of upload. 16 bytes. */
typedef struct LeafPhoton {
  float x, y, z;
  uint id;
} LeafPhoton;

/** What a photon carries beside its position, in the order of upload: 16 bytes, read at once. */
typedef struct PhotonPower {
  float power[3];     /**< W, RGB */
  short direction[2]; /**< of travel, octahedral (Cigolle et al. 2014) */
} PhotonPower;

/** Photons of a block of the wide tree, at most, but for a block that is a leaf of more. */
TREELIGHT_SHARED kBlockSize = 32u;

/** Levels of the wide tree, at most, and blocks that they are enough for. */
enum { kMaxWideLevels = 7 };
TREELIGHT_SHARED kMaxWideBlocks = 1u << 27;

/** Child of a node of the wide tree: 32 bytes. */
typedef struct WideBox {
  float min[3];
  uint min_id; /**< smallest photon index below */
  float max[3];
  uint first; /**< of a block its first photon in leaf order, of a node its first child */
} WideBox;

/** Where the levels of the wide tree lie in its array, blocks first. The last box of a level is
 * followed by one whose `first` ends it. */
typedef struct WideTree {
  uint offsets[kMaxWideLevels];
} WideTree;

/** What the device alone knows of a wide tree. */
typedef struct WideSizes {
  uint level_count;
  uint counts[kMaxWideLevels]; /**< boxes of each level; at most 32 on the last */
} WideSizes;

/** Maps a position to a Morton cell: cell = min((p - min) * prescale * scale, cells - 1), each
 * product rounded. `prescale` is 1, or a power of two that lifts an extent too small for its
 * reciprocal. */
typedef struct MortonGrid {
  float min[3];
  float prescale;
  float scale[3];
} MortonGrid;

/** A split level orders the boundaries between neighbours in leaf order: of the two boundaries of a
 * subtree, the one with the larger level is where the subtree meets its sibling. Levels below
 * kLevelIndex come from positions; kLevelIndex and up split photons by their place alone. */
TREELIGHT_SHARED kLevelIndex = 128u;
/** Level of the first cut of a subtree that a sweep rebuilds, and how many follow. */
TREELIGHT_SHARED kLevelSweep = 160u, kSweepLevels = 95u;
TREELIGHT_SHARED kLevelSame = 254u; /**< photons of equal codes at one position */
TREELIGHT_SHARED kLevelTied = 255u; /**< photons of equal codes, not yet told apart */

/** Leaves, and subtrees that are rebuilt, have no more photons. */
TREELIGHT_SHARED kMaxLeafWindow = 1024u;

/** Bits of a code that tells apart the photons of a run of equal codes. */
TREELIGHT_SHARED kTieBits = 30u;

/** Bits of an output mask. */
TREELIGHT_SHARED kOutputCount = 1u;
TREELIGHT_SHARED kOutputRadius = 2u;
TREELIGHT_SHARED kOutputNeighbors = 4u;
TREELIGHT_SHARED kOutputDensity = 8u;
TREELIGHT_SHARED kOutputStatistics = 16u;
TREELIGHT_SHARED kOutputErrorBound = 32u;

/** Density kernels. */
TREELIGHT_SHARED kKernelConstant = 0u;
TREELIGHT_SHARED kKernelCone = 1u;
TREELIGHT_SHARED kKernelEpanechnikov = 2u;

/** Moments of the powers of some photons about the middle of their box, of each channel: sum of
 * power, of power * offset (3), of power * offset^2; an offset is divided by the sum of the box's
 * three sides. 64 bytes. */
typedef struct PowerMoments {
  float channels[3][5]; /**< W */
  float absolute; /**< sum of the magnitudes of the powers, of the channel where it is largest */
} PowerMoments;

/** Arguments of the gather kernels that are the same for all queries of a launch. */
typedef struct GatherParams {
  Root root;
  uint first, count;          /**< queries of this launch, in the order of work */
  uint k;                     /**< neighbours kept, 0: no cap */
  float radius;               /**< scene units, where there are no radii for each query */
  uint outputs;               /**< mask of kOutput bits */
  uint density_kernel;        /**< kKernel */
  uint has_order;             /**< queries are worked on in the order of an array */
  uint has_radii;             /**< a radius for each query */
  uint has_normals;           /**< a normal for each query */
  float squared_stretch;      /**< Approximation::squared_stretch */
  uint max_leaves;            /**< Approximation::max_leaves, or as many as there can be */
  float largest_weight_error; /**< Approximation::weight_tolerance times the largest weight */
} GatherParams;

/** Measure of boxes, see core/model/heuristic.h. */
typedef struct MeasureParams {
  float prescale, scale, grow;
  uint volume; /**< the volume, else half of the surface area */
} MeasureParams;

/** Arguments of the sweep that are the same for all subtrees. */
typedef struct SweepParams {
  MeasureParams measure;
  uint max_leaf_size; /**< B, photons */
  uint unit_size;     /**< costs grow with the count of photons over this, rounded up: 1 or B */
} SweepParams;

/** Nothing is above: the place of the root among the children of nodes, 2 * node + side. */
TREELIGHT_SHARED kNoSlot = 0xffffffffu;

/** Bit of a height: all photons below become one leaf. */
TREELIGHT_SHARED kMergedBit = 0x80000000u;

/** What treelets know of the children of a node beside Node: left, right. */
typedef struct NodeCosts {
  float costs[2];      /**< see TreeletCost of core/cpu/treelet_search.h */
  uint leaf_counts[2]; /**< of the tree that is restructured */
  uint heights[2];     /**< edges, and kMergedBit */
} NodeCosts;

/** Leaves of a treelet, at most, whose sets of leaves a work-group can search. */
enum { kMaxSearchedTreelet = 9 };

/** Arguments of a round of treelet restructuring. */
typedef struct TreeletParams {
  MeasureParams measure;
  uint max_leaf_size; /**< B, photons */
  uint merges;        /**< subtrees of at most B photons may become one leaf */
  uint round;         /**< from 0 */
  uint leaf_count;    /**< of the tree */
  uint subset_ends[kMaxSearchedTreelet +
                   1]; /**< where sets of 0, 1 .. leaves end in the list of sets */
  float keep;          /**< a treelet stays unless a new one costs less than this part of it */
} TreeletParams;

#ifndef __OPENCL_C_VERSION__
static_assert(sizeof(Node) == 64 && sizeof(LeafPhoton) == 16 && sizeof(WideBox) == 32 &&
              sizeof(PhotonPower) == 16 && sizeof(PowerMoments) == 64);
}  // namespace treelight
#endif
#undef TREELIGHT_SHARED
#endif
