#ifndef TREELIGHT_SERVER_RELOADABLE_MAP_H_
#define TREELIGHT_SERVER_RELOADABLE_MAP_H_

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>

#include "absl/status/statusor.h"
#include "core/builder.h"
#include "server/memory_budget.h"

namespace treelight::server {

/// A tree on the device, and the host memory that it holds.
struct ResidentTree {
  std::unique_ptr<const Gatherer> gatherer;
  MemoryBudget::Share memory;
};

/// Where the photons of a map are while its tree is not on the device. Safe to call from several
/// threads at once.
class PhotonKeeper {
 public:
  virtual ~PhotonKeeper() = default;

  /// Whether Save() has nothing to do.
  virtual bool has_photons() const = 0;

  /// The tree is about to leave: its photons are taken from `gatherer`, unless they are kept
  /// anyway. RESOURCE_EXHAUSTED: there is no memory for them. The errors of Gatherer::ReadPhotons.
  virtual absl::Status Save(const Gatherer& gatherer) = 0;

  /// The tree is on the device, by which what was saved is of no more use.
  virtual void Forget() = 0;

  /// A copy of the photons. NOT_FOUND, DATA_LOSS: they are gone. RESOURCE_EXHAUSTED.
  virtual absl::StatusOr<Photons> Read() = 0;
};

/// A map whose tree may leave the device, since its photons are kept elsewhere. The tree comes back
/// when it is asked for, and is the same, bit for bit. Safe to call from several threads at once;
/// those that need the tree call on the thread of the device.
class ReloadableMap final : public Gatherer {
 public:
  /// What is known of the map without its tree.
  struct Description {
    std::uint64_t photon_count = 0;
    bool has_powers = false, has_directions = false;
    BuildReport report;
  };
  /// Builds the tree anew. The errors of Builder::Build, of reading the photons, and
  /// RESOURCE_EXHAUSTED for want of memory.
  using Load =
      std::function<absl::StatusOr<std::shared_ptr<const ResidentTree>>(const CancelCheck&)>;

  /// `load` may use `keeper`. `tree` is null where the map begins off the device.
  ReloadableMap(Description description, Load load, std::shared_ptr<PhotonKeeper> keeper,
                std::shared_ptr<const ResidentTree> tree);

  /// Whether the tree is on the device; and what it holds there at present, bytes.
  bool resident() const;
  std::uint64_t held_bytes() const;
  std::uint64_t idle_bytes() const;  ///< the same, 0 where somebody uses it
  bool leaves_at_once() const { return keeper_->has_photons(); }  ///< nothing is copied for it

  /// The tree where it is on the device, else null; it stays as long as somebody has it.
  std::shared_ptr<const ResidentTree> Hold() const;

  /// The tree, loaded where it is not on the device; stays there as long as somebody has it.
  absl::StatusOr<std::shared_ptr<const ResidentTree>> Acquire(const CancelCheck& cancelled) const;

  /// For the first who will have the tree loaded, a token for as long as that takes; null while
  /// there is one.
  std::shared_ptr<const void> ExpectLoad() const;

  /// Lets go of the tree, which the caller frees; null where it is in use, or not here, or where
  /// its photons cannot be kept. May copy them, and wait for the device to do so.
  std::shared_ptr<const ResidentTree> Evict() const;

  /// When the tree was used last.
  std::chrono::steady_clock::time_point last_use() const;

  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override;
  absl::StatusOr<Tree> ReadTree() const override;
  absl::StatusOr<Photons> ReadPhotons() const override;
  std::size_t photon_count() const override { return description_.photon_count; }
  bool has_powers() const override { return description_.has_powers; }
  bool has_directions() const override { return description_.has_directions; }
  const BuildReport& report() const override { return description_.report; }

 private:
  const Description description_;
  const Load load_;
  const std::shared_ptr<PhotonKeeper> keeper_;
  mutable std::mutex mutex_;
  mutable std::shared_ptr<const ResidentTree> tree_;        // guarded by mutex_; null: not here
  mutable std::chrono::steady_clock::time_point last_use_;  // guarded by mutex_
  mutable std::weak_ptr<const void> expected_load_;         // guarded by mutex_
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_RELOADABLE_MAP_H_
