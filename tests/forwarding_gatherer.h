#ifndef TREELIGHT_TESTS_FORWARDING_GATHERER_H_
#define TREELIGHT_TESTS_FORWARDING_GATHERER_H_

#include <memory>
#include <utility>

#include "core/gatherer.h"

namespace treelight::testing {

/// Another map, but for what a test overrides.
class ForwardingGatherer : public Gatherer {
 public:
  explicit ForwardingGatherer(std::unique_ptr<Gatherer> map) : map_(std::move(map)) {}

  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override {
    return map_->Gather(queries, options, cancelled);
  }
  absl::StatusOr<Tree> ReadTree() const override { return map_->ReadTree(); }
  absl::StatusOr<Photons> ReadPhotons() const override { return map_->ReadPhotons(); }
  std::size_t photon_count() const override { return map_->photon_count(); }
  bool has_powers() const override { return map_->has_powers(); }
  bool has_directions() const override { return map_->has_directions(); }
  const BuildReport& report() const override { return map_->report(); }

 private:
  const std::unique_ptr<Gatherer> map_;
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_FORWARDING_GATHERER_H_
