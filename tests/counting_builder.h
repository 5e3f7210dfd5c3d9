#ifndef TREELIGHT_TESTS_COUNTING_BUILDER_H_
#define TREELIGHT_TESTS_COUNTING_BUILDER_H_

#include <atomic>
#include <memory>

#include "core/builder.h"

namespace treelight {

/// Counts builds, and passes them on to the CPU's builder.
class CountingBuilder : public Builder {
 public:
  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck& cancelled) override {
    ++builds;
    return cpu_->Build(photons, options, cancelled);
  }
  std::atomic<int> builds = 0;

 private:
  const std::unique_ptr<Builder> cpu_ = MakeCpuBuilder();
};

}  // namespace treelight

#endif  // TREELIGHT_TESTS_COUNTING_BUILDER_H_
