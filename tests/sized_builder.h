#ifndef TREELIGHT_TESTS_SIZED_BUILDER_H_
#define TREELIGHT_TESTS_SIZED_BUILDER_H_

#include <memory>
#include <utility>

#include "core/builder.h"
#include "tests/forwarding_gatherer.h"

namespace treelight::testing {

/// Makes maps that say that they hold 64 B a photon.
class SizedBuilder final : public Builder {
 public:
  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck& cancelled) override {
    auto map = builder_->Build(photons, options, cancelled);
    if (!map.ok()) return map.status();
    return std::make_unique<SizedMap>(*std::move(map));
  }

 private:
  class SizedMap final : public ForwardingGatherer {
   public:
    explicit SizedMap(std::unique_ptr<Gatherer> map) : ForwardingGatherer(std::move(map)) {
      report_ = ForwardingGatherer::report();
      report_.device_bytes = 64 * photon_count();
    }
    const BuildReport& report() const override { return report_; }

   private:
    BuildReport report_;
  };
  const std::unique_ptr<Builder> builder_ = MakeCpuBuilder();
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_SIZED_BUILDER_H_
