#ifndef TREELIGHT_SERVER_HOST_PHOTONS_H_
#define TREELIGHT_SERVER_HOST_PHOTONS_H_

#include <mutex>
#include <optional>
#include <string>

#include "server/convert.h"
#include "server/reloadable_map.h"
#include "server/state.h"

namespace treelight::server {

/// Photons of a map that has no file: in the host's memory while its tree is not on the device,
/// paid for from the memory budget.
class HostPhotons final : public PhotonKeeper {
 public:
  /// Of the map that was built by `plan`; `state` outlives it.
  HostPhotons(State& state, const BuildPlan& plan);

  bool has_photons() const override { return false; }
  absl::Status Save(const Gatherer& gatherer) override;
  void Forget() override;
  absl::StatusOr<Photons> Read() override;

 private:
  State& state_;
  const std::string what_;
  const std::uint64_t bytes_;
  std::mutex mutex_;
  MemoryBudget::Share memory_;      // guarded by mutex_
  std::optional<Photons> photons_;  // guarded by mutex_; none: the tree has them
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_HOST_PHOTONS_H_
