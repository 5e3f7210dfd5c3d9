#include "server/host_photons.h"

#include <utility>

#include "fmt/format.h"
#include "server/guard.h"
#include "server/upload.h"

namespace treelight::server {

HostPhotons::HostPhotons(State& state, const BuildPlan& plan)
    : state_(state),
      what_(
          fmt::format("map '{}' with {} photons leaves the device", plan.name, plan.photon_count)),
      bytes_(PhotonBytes(plan)) {}

absl::Status HostPhotons::Save(const Gatherer& gatherer) {
  auto memory = state_.memory.Take(Holder::kMaps, bytes_, what_, state_.device_queue.RetryDelay());
  if (!memory.ok()) return memory.status();
  return Guard([&] {
    auto photons = gatherer.ReadPhotons();
    if (!photons.ok()) return photons.status();
    const std::lock_guard lock(mutex_);
    memory_ = *std::move(memory);
    photons_ = *std::move(photons);
    return absl::OkStatus();
  });
}

void HostPhotons::Forget() {
  const std::lock_guard lock(mutex_);
  photons_.reset();
  memory_ = {};  // given back after what it paid for
}

absl::StatusOr<Photons> HostPhotons::Read() {
  const std::lock_guard lock(mutex_);
  if (!photons_) return absl::NotFoundError("the tree has them");
  return *photons_;
}

}  // namespace treelight::server
