#ifndef TREELIGHT_TESTS_MERGED_MAPS_H_
#define TREELIGHT_TESTS_MERGED_MAPS_H_

#include <cstdint>
#include <map>
#include <memory>

#include "core/builder.h"
#include "core/merge_choice.h"
#include "core/merged_gather.h"
#include "core/model/merge_photons.h"
#include "core/model/thin_photons.h"
#include "gtest/gtest.h"

namespace treelight {

/// Costs of a device that takes 60 ns for the place of a query and one for each photon, whatever
/// the batch and the kind.
inline absl::StatusOr<GatherCosts> PlainCosts(GatherKind) {
  GatherCosts costs;
  double photons = GatherCosts::kFewest;
  for (GatherCosts::Cost& cost : costs.entries) {
    cost.query_us = (60 + photons) / 1000;
    photons *= 2;
  }
  return costs;
}

/// A map with maps of fewer photons of every size, made by the same builder on first use.
class MergedMaps {
 public:
  MergedMaps(Builder& builder, const Photons& photons, const BuildOptions& options = {})
      : builder_(builder), options_(options), map_(*builder.Build(photons, options)) {}

  const Gatherer& map() const { return *map_; }
  MapOfFewer Merged(std::uint32_t group_size) {
    return Fewer({FewerPhotons::Kind::kMerged, group_size});
  }
  MapOfFewer Fewer(const FewerPhotons& fewer) {
    auto& merged = merged_[fewer];
    if (merged.map == nullptr) {
      const Photons all = *map_->ReadPhotons();
      const Photons photons = fewer.kind == FewerPhotons::Kind::kMerged
                                  ? MergePhotons(*map_->ReadTree(), all, fewer.group_size)
                                  : ThinPhotons(all, fewer.group_size);
      merged = {*builder_.Build(photons, options_), MeanPower(photons)};
    }
    return merged;
  }
  MergeChoice Choose(const GatherQueries& queries, const GatherOptions& options,
                     const CostsOf& costs = PlainCosts) {
    const auto merged = [this](const FewerPhotons& fewer) { return Fewer(fewer); };
    const auto choice = ChooseMerge(*map_, merged, costs, queries, options);
    EXPECT_TRUE(choice.ok()) << choice.status();
    return choice.ok() ? *choice : MergeChoice();
  }

 private:
  Builder& builder_;
  const BuildOptions options_;
  const std::unique_ptr<Gatherer> map_;
  std::map<FewerPhotons, MapOfFewer> merged_;
};

}  // namespace treelight

#endif  // TREELIGHT_TESTS_MERGED_MAPS_H_
