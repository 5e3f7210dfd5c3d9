#include <CGAL/Fuzzy_sphere.h>
#include <CGAL/Kd_tree.h>
#include <CGAL/Orthogonal_k_neighbor_search.h>
#include <CGAL/Search_traits_3.h>
#include <CGAL/Search_traits_adapter.h>
#include <CGAL/Simple_cartesian.h>

#include <cmath>
#include <iterator>
#include <utility>

#include "tests/peers/peer.h"

namespace treelight {
namespace {

using Kernel = CGAL::Simple_cartesian<float>;
using Point = Kernel::Point_3;
using Item = std::pair<Point, std::uint32_t>;
using Traits = CGAL::Search_traits_adapter<Item, CGAL::First_of_pair_property_map<Item>,
                                           CGAL::Search_traits_3<Kernel>>;
using Knn = CGAL::Orthogonal_k_neighbor_search<Traits>;
using Tree = Knn::Tree;
using Sphere = CGAL::Fuzzy_sphere<Traits>;

/// Counts what is written to it.
class CountOutput {
 public:
  using iterator_category = std::output_iterator_tag;
  using value_type = void;
  using difference_type = std::ptrdiff_t;
  using pointer = void;
  using reference = void;

  explicit CountOutput(std::uint32_t& count) : count_(&count) {}
  CountOutput& operator=(const Item&) {
    ++*count_;
    return *this;
  }
  CountOutput& operator*() { return *this; }
  CountOutput& operator++() { return *this; }
  CountOutput& operator++(int) { return *this; }

 private:
  std::uint32_t* count_;
};

class CgalPeer : public Peer {
 public:
  explicit CgalPeer(unsigned bucket_size) : bucket_size_(bucket_size) {}

  std::string name() const override { return "CGAL bucket " + std::to_string(bucket_size_); }

  void Build(const std::vector<float>& positions) override {
    std::vector<Item> items;
    items.reserve(positions.size() / 3);
    for (std::size_t i = 0; i < positions.size(); i += 3) {
      items.emplace_back(Point(positions[i], positions[i + 1], positions[i + 2]),
                         static_cast<std::uint32_t>(i / 3));
    }
    tree_ = std::make_unique<Tree>(items.begin(), items.end(), Knn::Splitter(bucket_size_));
    tree_->build();
  }

  void Find(std::span<const float> queries, const Search& search, Found& found) const override {
    const float squared_radius = search.radius * search.radius;
    for (std::size_t i = 0; 3 * i < queries.size(); ++i) {
      const Point center(queries[3 * i], queries[3 * i + 1], queries[3 * i + 2]);
      if (search.k == 0) {
        found.counts[i] = 0;
        tree_->search(CountOutput(found.counts[i]), Sphere(center, search.radius));
        continue;
      }
      // It knows no radius together with k.
      const Knn knn(*tree_, center, search.k);
      std::uint32_t count = 0;
      for (const auto& [item, squared_distance] : knn) {
        if (squared_distance > squared_radius) break;
        found.ids[i * search.k + count] = item.second;
        found.squared_distances[i * search.k + count++] = squared_distance;
      }
      found.counts[i] = count;
    }
  }

 private:
  const unsigned bucket_size_;
  std::unique_ptr<Tree> tree_;
};

}  // namespace

std::unique_ptr<Peer> MakeCgal(unsigned bucket_size) {
  return std::make_unique<CgalPeer>(bucket_size);
}

}  // namespace treelight
