#include "tests/peers/treelight_peer.h"

#include <stdexcept>
#include <utility>

namespace treelight {
namespace {

template <typename T>
T Checked(absl::StatusOr<T> result) {
  if (!result.ok()) throw std::runtime_error(std::string(result.status().message()));
  return *std::move(result);
}

class TreelightPeer : public Peer {
 public:
  TreelightPeer(std::string name, std::shared_ptr<Builder> builder, const BuildOptions& options)
      : name_(std::move(name)), builder_(std::move(builder)), options_(options) {}

  std::string name() const override { return name_; }

  void Build(const std::vector<float>& positions) override {
    map_.reset();
    map_ = Checked(
        builder_->Build({.positions = positions, .powers = {}, .directions = {}}, options_));
  }

  void Find(std::span<const float> queries, const Search& search, Found& found) const override {
    const std::uint32_t outputs = search.k > 0 ? kOutputCount | kOutputNeighbors : kOutputCount;
    GatherResult result = Checked(map_->Gather(
        {.positions = queries}, {.k = search.k, .radius = search.radius, .outputs = outputs}));
    found.counts = std::move(result.counts);
    found.ids = std::move(result.neighbor_ids);
    found.squared_distances = std::move(result.neighbor_squared_distances);
  }

 private:
  const std::string name_;
  const std::shared_ptr<Builder> builder_;
  const BuildOptions options_;
  std::unique_ptr<Gatherer> map_;
};

}  // namespace

std::unique_ptr<Peer> MakeTreelight(std::string name, std::shared_ptr<Builder> builder,
                                    const BuildOptions& options) {
  return std::make_unique<TreelightPeer>(std::move(name), std::move(builder), options);
}

}  // namespace treelight
