#ifndef TREELIGHT_TESTS_PEERS_PEER_H_
#define TREELIGHT_TESTS_PEERS_PEER_H_

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace treelight {

/// What is asked of a library: the k nearest within a radius, or how many there are.
struct Search {
  std::uint32_t k = 0;  ///< 0: count
  float radius = 0;     ///< scene units; may be infinite where k > 0
};

/// Answers of m queries. Neighbours are nearest first; where fewer than k are within the radius the
/// rest of the list is undefined.
struct Found {
  std::vector<std::uint32_t> counts;     ///< [m]
  std::vector<std::uint32_t> ids;        ///< [m * k]
  std::vector<float> squared_distances;  ///< [m * k]

  void Resize(std::size_t m, std::uint32_t k) {
    counts.resize(m);
    ids.resize(m * k);
    squared_distances.resize(m * k);
  }
};

/// A library at one of its settings, over one set of points.
class Peer {
 public:
  virtual ~Peer() = default;
  virtual std::string name() const = 0;  ///< with the setting
  /// Builds the index; what was built before is dropped.
  /// @param positions  [3n]; stays where it is
  virtual void Build(const std::vector<float>& positions) = 0;
  /// Answers queries [3m] in the arrays of `found`, which are long enough.
  virtual void Find(std::span<const float> queries, const Search& search, Found& found) const = 0;
};

std::unique_ptr<Peer> MakeNanoflann(std::size_t leaf_size);
std::unique_ptr<Peer> MakeFlann(int leaf_size);
std::unique_ptr<Peer> MakeCgal(unsigned bucket_size);

}  // namespace treelight

#endif  // TREELIGHT_TESTS_PEERS_PEER_H_
