#include "server/reloadable_map.h"

#include <utility>

#include "server/break_switch.h"

namespace treelight::server {

ReloadableMap::ReloadableMap(Description description, Load load,
                             std::shared_ptr<PhotonKeeper> keeper,
                             std::shared_ptr<const ResidentTree> tree)
    : description_(std::move(description)),
      load_(std::move(load)),
      keeper_(std::move(keeper)),
      tree_(std::move(tree)),
      last_use_(std::chrono::steady_clock::now()) {}

bool ReloadableMap::resident() const {
  const std::lock_guard lock(mutex_);
  return tree_ != nullptr;
}

std::uint64_t ReloadableMap::held_bytes() const {
  const std::lock_guard lock(mutex_);
  return tree_ == nullptr ? 0 : tree_->gatherer->report().device_bytes;
}

std::uint64_t ReloadableMap::idle_bytes() const {
  const std::lock_guard lock(mutex_);
  return tree_.use_count() == 1 ? tree_->gatherer->report().device_bytes : 0;
}

std::shared_ptr<const ResidentTree> ReloadableMap::Hold() const {
  const std::lock_guard lock(mutex_);
  if (tree_ != nullptr) last_use_ = std::chrono::steady_clock::now();
  return tree_;
}

absl::StatusOr<std::shared_ptr<const ResidentTree>> ReloadableMap::Acquire(
    const CancelCheck& cancelled) const {
  {
    const std::lock_guard lock(mutex_);
    last_use_ = std::chrono::steady_clock::now();
    if (tree_ != nullptr) return tree_;
  }
  // One thread at a time is here: the device's.
  auto loaded = load_(cancelled);
  if (!loaded.ok()) return loaded;
  const std::lock_guard lock(mutex_);
  if (Broken("loaded_once")) return loaded;
  tree_ = *loaded;
  keeper_->Forget();
  last_use_ = std::chrono::steady_clock::now();
  return loaded;
}

std::shared_ptr<const void> ReloadableMap::ExpectLoad() const {
  const std::lock_guard lock(mutex_);
  if (!expected_load_.expired()) return nullptr;
  const auto token = std::make_shared<const int>(0);
  expected_load_ = token;
  return token;
}

std::shared_ptr<const ResidentTree> ReloadableMap::Evict() const {
  std::shared_ptr<const ResidentTree> leaving;
  {
    const std::lock_guard lock(mutex_);
    if (tree_.use_count() != 1) return nullptr;
    leaving = tree_;  // from here on nobody else lets it leave
  }
  const bool saved = keeper_->Save(*leaving->gatherer).ok();
  const std::lock_guard lock(mutex_);
  if (!saved || leaving.use_count() > 2) {  // somebody has come for it meanwhile
    keeper_->Forget();
    return nullptr;
  }
  tree_.reset();
  return leaving;
}

absl::StatusOr<Photons> ReloadableMap::ReadPhotons() const {
  while (true) {
    std::shared_ptr<const ResidentTree> tree;
    std::chrono::steady_clock::time_point used;
    {
      const std::lock_guard lock(mutex_);
      tree = tree_;
      used = last_use_;
    }
    // What is saved stays as long as the tree is away.
    auto photons = keeper_->Read();
    if (!absl::IsNotFound(photons.status())) return photons;
    if (tree != nullptr) return tree->gatherer->ReadPhotons();
    const std::lock_guard lock(mutex_);
    if (last_use_ == used) return photons;  // else it may have come back, by which nothing is saved
  }
}

std::chrono::steady_clock::time_point ReloadableMap::last_use() const {
  const std::lock_guard lock(mutex_);
  return last_use_;
}

absl::StatusOr<GatherResult> ReloadableMap::Gather(const GatherQueries& queries,
                                                   const GatherOptions& options,
                                                   const CancelCheck& cancelled) const {
  const auto tree = Acquire(cancelled);
  if (!tree.ok()) return tree.status();
  return (*tree)->gatherer->Gather(queries, options, cancelled);
}

absl::StatusOr<Tree> ReloadableMap::ReadTree() const {
  const auto tree = Acquire({});
  if (!tree.ok()) return tree.status();
  return (*tree)->gatherer->ReadTree();
}

}  // namespace treelight::server
