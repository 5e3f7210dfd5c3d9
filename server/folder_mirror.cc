#include "server/folder_mirror.h"

#include <algorithm>
#include <utility>

#include "server/break_switch.h"
#include "server/guard.h"
#include "server/persistence.h"
#include "server/state.h"
#include "server/tell.h"

namespace treelight::server {
namespace {

/// How long the time of a change may stand for later changes too: two ticks of a slow kernel, or,
/// where the file system tells whole seconds, two of those.
std::chrono::milliseconds Grain(std::int64_t changed_ns) {
  constexpr std::chrono::milliseconds kTicks{20}, kSeconds{2000};
  return changed_ns % 1'000'000'000 == 0 ? kSeconds : kTicks;
}

/// Whether TakeUp has told why it cannot load a file, and nothing but another file mends that.
bool IsLeftAlone(const absl::StatusOr<MapHandle>& taken) {
  return absl::IsUnimplemented(taken.status()) || absl::IsPermissionDenied(taken.status());
}

}  // namespace

FolderMirror::Transit::Transit(FolderMirror& mirror,
                               const std::function<std::vector<std::string>()>& begin)
    : mirror_(mirror) {
  const std::lock_guard lock(mirror_.updating_);
  files_ = begin();
  mirror_.in_transit_.insert(files_.begin(), files_.end());
}

FolderMirror::Transit::~Transit() {
  const std::lock_guard lock(mirror_.updating_);
  for (const std::string& file : files_) {
    mirror_.in_transit_.erase(mirror_.in_transit_.find(file));
  }
}

absl::Status FolderMirror::Begin(const std::vector<SnapshotFolder::File>& files) {
  const std::lock_guard lock(updating_);
  for (const SnapshotFolder::File& file : files) {
    const auto taken = TakeUp(state_, file);
    if (absl::IsInternal(taken.status())) return taken.status();
    known_[file.name] = {.id = file.id, .left_alone = IsLeftAlone(taken)};
  }
  return absl::OkStatus();
}

bool FolderMirror::UpToDate() {
  const auto changed = state_.snapshots->Changed();
  if (!changed.ok()) return false;  // the list will tell
  const auto now = Clock::now();
  const std::lock_guard lock(times_);
  if (*changed != changed_) {
    changed_ = *changed;
    first_seen_ = now;
    return false;
  }
  return listed_ >= first_seen_ + Grain(changed_);
}

void FolderMirror::Update() { UpdateSince(Clock::now()); }

void FolderMirror::UpdateSince(Clock::time_point asked) {
  if (UpToDate()) return;
  const std::lock_guard lock(updating_);
  {
    // One list answers all who asked before it was begun.
    const std::lock_guard times(times_);
    if (listed_ >= asked) return;
  }
  UpToDate();  // takes note of the last change before the list
  const auto begun = Clock::now();
  const auto status = Guard([this] { return Compare(); });
  if (!status.ok()) {
    if (!std::exchange(told_failure_, true)) {
      Tell(std::string(status.message()));
    }
    return;
  }
  told_failure_ = false;
  const std::lock_guard times(times_);
  listed_ = begun;
}

/// Puts right what differs between store and folder.
absl::Status FolderMirror::Compare() {
  const auto entries = state_.snapshots->List();
  if (!entries.ok()) return entries.status();
  std::map<std::string, MapHandle> stored;
  for (const MapHandle& map : state_.store.List()) {
    stored.emplace(SnapshotName(map->name, map->version), map);
  }
  for (const std::string& file : in_transit_) stored.erase(file);
  std::map<std::string, Known> known;  // of the files that are here still
  for (const SnapshotFolder::Entry& entry : *entries) {
    if (in_transit_.contains(entry.name)) continue;
    const auto map = stored.find(entry.name);
    const auto seen = known_.find(entry.name);
    const bool same = seen != known_.end() && seen->second.id == entry.id;
    if (same && (map != stored.end() || seen->second.left_alone)) {
      known.insert(*seen);
      if (map != stored.end()) stored.erase(map);
      continue;
    }
    const SnapshotFolder::File file = state_.snapshots->ReadHead(entry);
    if (absl::IsNotFound(file.head.status())) continue;  // removed since it was listed
    known[entry.name] = {.id = file.id};
    if (map != stored.end()) {
      // Touched, or written by this server.
      const bool kept = file.head.ok() && file.head->checksum == map->second->checksum;
      if (!kept) state_.store.Drop({map->second});
      stored.erase(map);
      if (kept) continue;
    }
    known[entry.name].left_alone = IsLeftAlone(TakeUp(state_, file));
  }
  known_ = std::move(known);
  std::vector<MapHandle> gone;
  for (auto& [name, map] : stored) gone.push_back(std::move(map));
  state_.store.Drop(gone);
  return absl::OkStatus();
}

void WithNewestMaps(State& state, std::function<void()> then) {
  if (state.mirror == nullptr || state.mirror->UpToDate() || Broken("alike")) return then();
  state.lookups.Submit([&state, asked = FolderMirror::Clock::now(), then = std::move(then)] {
    state.mirror->UpdateSince(asked);
    then();
  });
}

}  // namespace treelight::server
