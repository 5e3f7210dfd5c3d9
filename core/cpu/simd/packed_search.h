#ifndef TREELIGHT_CORE_CPU_SIMD_PACKED_SEARCH_H_
#define TREELIGHT_CORE_CPU_SIMD_PACKED_SEARCH_H_

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string_view>
#include <vector>

#include "core/gatherer.h"
#include "core/model/tree.h"

namespace treelight {

/// What a search found, and where it works; one for each task, used again for every query.
/// Candidate i is (squared_distances[i], ids[i]).
class SearchSpace {
 public:
  /// Room for `count` candidates, and a vector more; what is there stays.
  void Reserve(std::uint32_t count);

  /// Of `count` candidates from `first` on, which are all at one distance, moves the `keep` with
  /// the smallest ids to the front.
  void KeepSmallestIds(std::uint32_t first, std::uint32_t count, std::uint32_t keep);

  /// Sorts the first `count` candidates by (squared distance, id).
  void Sort(std::uint32_t count);

  std::uint32_t capacity() const { return capacity_; }
  float* squared_distances() { return squared_distances_.data(); }
  std::uint32_t* ids() { return ids_.data(); }

  /// A second pair of arrays, as long.
  float* spare_squared_distances() { return spare_squared_distances_.data(); }
  std::uint32_t* spare_ids() { return spare_ids_.data(); }
  void SwapSpare();  ///< changes the two pairs

 private:
  std::uint32_t capacity_ = 0;
  std::vector<float> squared_distances_, spare_squared_distances_;
  std::vector<std::uint32_t> ids_, spare_ids_;
  std::vector<std::uint64_t> keys_;
};

/// What FindNearest found.
struct FoundNearest {
  std::uint32_t count = 0;
  float farthest = 0;  ///< largest squared distance, 0 where nothing was found
  /// Squared distance of the nearest subtree that was left out and might have held one of the k;
  /// +inf: none.
  float given_up = std::numeric_limits<float>::infinity();
};

/// A subtree that lies within the limit of a search whole.
struct WholeSubtree {
  std::uint32_t slot;  ///< which child of the tree it is: 2 * node + side
  std::uint32_t count;
  Box box;
  float near, far;  ///< squared distances of the nearest place and the farthest corner of the box
};

/// Searches in a tree by the vector instructions of one kind of processor. Safe to call from
/// several threads at once, each with its own space.
class PackedSearch {
 public:
  virtual ~PackedSearch() = default;

  /// Finds the k >= 1 nearest by (squared distance, id) of the photons with a squared distance of
  /// at most `limit`, which is finite, in no order.
  virtual FoundNearest FindNearest(const Vec3& center, std::uint32_t k, float limit,
                                   SearchSpace& space) const = 0;

  /// The same, but for what `approximation` gives up. A block of photons is a leaf.
  virtual FoundNearest FindAboutNearest(const Vec3& center, std::uint32_t k, float limit,
                                        const Approximation& approximation,
                                        SearchSpace& space) const = 0;

  /// Finds all photons with a squared distance of at most `limit`, finite, in no order. Where
  /// `take` is given, it is called with the number of those in `space` whenever there are many, and
  /// they are dropped; what is returned is the number of those left.
  virtual std::uint32_t FindWithin(const Vec3& center, float limit, SearchSpace& space,
                                   const std::function<void(std::uint32_t)>& take = {}) const = 0;

  /// The same, without the photons of the whole subtrees that `take_whole` is called with and says
  /// true to.
  virtual std::uint32_t FindWithinBeside(const Vec3& center, float limit,
                                         const std::function<bool(const WholeSubtree&)>& take_whole,
                                         SearchSpace& space,
                                         const std::function<void(std::uint32_t)>& take) const = 0;

  /// How many FindWithin finds. Whole subtrees within are counted without a look at their photons.
  virtual std::uint32_t CountWithin(const Vec3& center, float limit) const = 0;

  /// Sorts what was found.
  virtual void Sort(std::uint32_t count, SearchSpace& space) const = 0;

  virtual std::size_t bytes() const = 0;  ///< of the packed tree
};

/// Kinds of instructions, the wider the later.
enum class Instructions { kPlain, kAvx2, kAvx512 };

/// "plain C++", "AVX2", "AVX-512".
std::string_view NameOf(Instructions instructions);

/// What this processor has, widest last.
std::vector<Instructions> SupportedInstructions();

/// Packs `tree`.
/// @param instructions  one that this processor has
std::unique_ptr<PackedSearch> MakePackedSearch(const Tree& tree, Instructions instructions);

// One for each kind, each compiled for it; see packed_search_impl.h.
std::unique_ptr<PackedSearch> MakePlainSearch(const Tree& tree);
std::unique_ptr<PackedSearch> MakeAvx2Search(const Tree& tree);
std::unique_ptr<PackedSearch> MakeAvx512Search(const Tree& tree);

}  // namespace treelight

#endif  // TREELIGHT_CORE_CPU_SIMD_PACKED_SEARCH_H_
