#ifndef TREELIGHT_TESTS_GATED_BUILDER_H_
#define TREELIGHT_TESTS_GATED_BUILDER_H_

#include <atomic>
#include <chrono>
#include <memory>
#include <thread>
#include <utility>

#include "absl/status/status.h"
#include "core/builder.h"
#include "tests/forwarding_gatherer.h"

namespace treelight::testing {

/// Holds back gathers and builds of a GatedBuilder, and counts them.
struct Gate {
  std::atomic<bool> open = true;
  std::atomic<int> gathers = 0;  ///< begun
  std::atomic<int> builds = 0;   ///< begun
  std::atomic<int> stopped = 0;  ///< of both, because they were cancelled

  /// Waits until the gate is open; CANCELLED where `cancelled` says so first, as between two
  /// launches.
  absl::Status Pass(const CancelCheck& cancelled) {
    while (!open) {
      if (cancelled && cancelled()) {
        ++stopped;
        return absl::CancelledError("stopped between launches");
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return absl::OkStatus();
  }
};

/// Brute force behind a gate.
class GatedGatherer : public ForwardingGatherer {
 public:
  GatedGatherer(std::shared_ptr<Gate> gate, std::unique_ptr<Gatherer> map)
      : ForwardingGatherer(std::move(map)), gate_(std::move(gate)) {}

  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override {
    ++gate_->gathers;
    if (auto status = gate_->Pass(cancelled); !status.ok()) return status;
    return ForwardingGatherer::Gather(queries, options, cancelled);
  }

 private:
  std::shared_ptr<Gate> gate_;
};

/// Makes GatedGatherers; its builds pass the gate too.
class GatedBuilder : public Builder {
 public:
  explicit GatedBuilder(std::shared_ptr<Gate> gate) : gate_(std::move(gate)) {}

  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck& cancelled) override {
    ++gate_->builds;
    if (auto status = gate_->Pass(cancelled); !status.ok()) return status;
    auto map = MakeBruteForceBuilder()->Build(photons, options);
    if (!map.ok()) return map.status();
    return std::make_unique<GatedGatherer>(gate_, *std::move(map));
  }

  /// As a device has it that leaves what it has no stages for to its host.
  std::uint64_t WorkBytes(const BuildOptions& options, std::uint64_t photon_count) const override {
    return HasDeviceStages(options) ? 0 : 200 * photon_count;
  }

 private:
  std::shared_ptr<Gate> gate_;
};

/// Waits until `condition` holds; false after ten seconds.
template <typename Condition>
bool Eventually(Condition condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_GATED_BUILDER_H_
