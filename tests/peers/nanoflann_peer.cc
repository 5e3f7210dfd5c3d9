#include <cmath>
#include <limits>
#include <nanoflann.hpp>

#include "tests/peers/peer.h"

namespace treelight {
namespace {

/// Positions [3n] as nanoflann reads them.
struct Cloud {
  const std::vector<float>* positions = nullptr;
  std::size_t kdtree_get_point_count() const { return positions->size() / 3; }
  float kdtree_get_pt(std::size_t i, std::size_t axis) const { return (*positions)[3 * i + axis]; }
  template <typename Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud>, Cloud,
                                                 3, std::uint32_t>;

/// Counts what is within the radius.
class CountResults {
 public:
  explicit CountResults(float squared_radius) : squared_radius_(squared_radius) {}
  std::size_t size() const { return count_; }
  bool full() const { return true; }
  bool addPoint(float squared_distance, std::uint32_t) {
    if (squared_distance <= squared_radius_) ++count_;
    return true;
  }
  float worstDist() const { return squared_radius_; }

 private:
  const float squared_radius_;
  std::uint32_t count_ = 0;
};

class NanoflannPeer : public Peer {
 public:
  explicit NanoflannPeer(std::size_t leaf_size) : leaf_size_(leaf_size) {}

  std::string name() const override { return "nanoflann leaf " + std::to_string(leaf_size_); }

  void Build(const std::vector<float>& positions) override {
    cloud_.positions = &positions;
    tree_ =
        std::make_unique<Tree>(3, cloud_, nanoflann::KDTreeSingleIndexAdaptorParams(leaf_size_));
    tree_->buildIndex();
  }

  void Find(std::span<const float> queries, const Search& search, Found& found) const override {
    const nanoflann::SearchParams params;
    const float squared_radius = search.radius * search.radius;
    for (std::size_t i = 0; 3 * i < queries.size(); ++i) {
      const float* const query = &queries[3 * i];
      if (search.k == 0) {
        CountResults results(squared_radius);
        tree_->findNeighbors(results, query, params);
        found.counts[i] = static_cast<std::uint32_t>(results.size());
        continue;
      }
      nanoflann::KNNResultSet<float, std::uint32_t> results(search.k);
      float* const distances = &found.squared_distances[i * search.k];
      results.init(&found.ids[i * search.k], distances);
      // The distance that the last one has to beat.
      if (std::isfinite(squared_radius)) {
        distances[search.k - 1] = std::nextafter(squared_radius, std::numeric_limits<float>::max());
      }
      tree_->findNeighbors(results, query, params);
      found.counts[i] = static_cast<std::uint32_t>(results.size());
    }
  }

 private:
  const std::size_t leaf_size_;
  Cloud cloud_;
  std::unique_ptr<Tree> tree_;
};

}  // namespace

std::unique_ptr<Peer> MakeNanoflann(std::size_t leaf_size) {
  return std::make_unique<NanoflannPeer>(leaf_size);
}

}  // namespace treelight
