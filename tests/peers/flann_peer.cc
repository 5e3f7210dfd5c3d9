#include <algorithm>
#include <cmath>
#include <flann/flann.hpp>

#include "tests/peers/peer.h"

namespace treelight {
namespace {

using Index = flann::KDTreeSingleIndex<flann::L2_Simple<float>>;

class FlannPeer : public Peer {
 public:
  explicit FlannPeer(int leaf_size) : leaf_size_(leaf_size) {}

  std::string name() const override { return "FLANN leaf " + std::to_string(leaf_size_); }

  void Build(const std::vector<float>& positions) override {
    // FLANN only reads them, since it reorders a copy.
    const flann::Matrix<float> points(const_cast<float*>(positions.data()), positions.size() / 3,
                                      3);
    index_ = std::make_unique<Index>(points, flann::KDTreeSingleIndexParams(leaf_size_));
    index_->buildIndex();
  }

  void Find(std::span<const float> queries, const Search& search, Found& found) const override {
    const std::size_t m = queries.size() / 3;
    const flann::Matrix<float> points(const_cast<float*>(queries.data()), m, 3);
    flann::SearchParams params(flann::FLANN_CHECKS_UNLIMITED);
    params.sorted = search.k > 0;
    params.cores = 1;
    if (search.k > 0 && std::isinf(search.radius)) {
      std::vector<std::size_t> ids(m * search.k);
      flann::Matrix<std::size_t> id_matrix(ids.data(), m, search.k);
      flann::Matrix<float> distances(found.squared_distances.data(), m, search.k);
      index_->knnSearch(points, id_matrix, distances, search.k, params);
      std::copy(ids.begin(), ids.end(), found.ids.begin());
      const std::size_t most = std::min<std::size_t>(search.k, index_->size());
      std::fill_n(found.counts.begin(), m, static_cast<std::uint32_t>(most));
      return;
    }
    params.max_neighbors = static_cast<int>(search.k);  // 0: counts only
    std::vector<std::size_t> ids(std::max(1u, search.k));
    std::vector<float> distances(ids.size());
    for (std::size_t i = 0; i < m; ++i) {
      const flann::Matrix<float> query(const_cast<float*>(&queries[3 * i]), 1, 3);
      flann::Matrix<std::size_t> id_row(ids.data(), 1, ids.size());
      flann::Matrix<float> distance_row(distances.data(), 1, distances.size());
      const int count =
          index_->radiusSearch(query, id_row, distance_row, search.radius * search.radius, params);
      found.counts[i] = search.k == 0 ? static_cast<std::uint32_t>(count)
                                      : std::min(static_cast<std::uint32_t>(count), search.k);
      if (search.k == 0) continue;
      std::copy_n(ids.begin(), found.counts[i],
                  found.ids.begin() + static_cast<std::ptrdiff_t>(i * search.k));
      std::copy_n(distances.begin(), found.counts[i],
                  found.squared_distances.begin() + static_cast<std::ptrdiff_t>(i * search.k));
    }
  }

 private:
  const int leaf_size_;
  mutable std::unique_ptr<Index> index_;
};

}  // namespace

std::unique_ptr<Peer> MakeFlann(int leaf_size) { return std::make_unique<FlannPeer>(leaf_size); }

}  // namespace treelight
