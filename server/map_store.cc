#include "server/map_store.h"

#include <algorithm>
#include <utility>

#include "fmt/format.h"
#include "fmt/ranges.h"
#include "server/break_switch.h"

namespace treelight::server {

MapStore::MapStore(Clock clock, std::size_t dead_names)
    : clock_(std::move(clock)),
      dead_names_(dead_names),
      sweeper_([this](const std::stop_token& stop) { SweepInTime(stop); }) {}

bool MapStore::Expired(const StoredMap& map) const {
  return map.expires.has_value() && *map.expires <= clock_() && !Broken("expiry");
}

MapHandle MapStore::Add(StoredMap map) {
  auto handle = std::make_shared<StoredMap>(std::move(map));
  {
    const std::lock_guard lock(mutex_);
    if (!handle->request_id.empty() && !Broken("request_id")) {
      const auto [known, added] = requests_.try_emplace(handle->request_id, handle);
      if (!added) {
        if (!Expired(*known->second)) return known->second;
        known->second = handle;
      }
    }
    if (handle->version == 0) handle->version = NextVersion(handle->name);
    Insert(handle);
    ++additions_;
    ForgetDeadNames();
  }
  wake_.notify_one();
  return handle;
}

std::uint64_t MapStore::NextVersion(const std::string& name) {
  if (Broken("version")) return maps_.contains(name) ? maps_[name].rbegin()->first + 1 : 1;
  return ++last_versions_.try_emplace(name, forgotten_version_).first->second;
}

std::uint64_t MapStore::ReserveVersion(const std::string& name) {
  const std::lock_guard lock(mutex_);
  return NextVersion(name);
}

void MapStore::Restore(const std::vector<MapHandle>& maps) {
  {
    const std::lock_guard lock(mutex_);
    for (const MapHandle& map : maps) {
      if (Insert(map) && !map->request_id.empty() && !Broken("request_id_of_last_life")) {
        requests_.try_emplace(map->request_id, map);
      }
    }
    ++additions_;
    ForgetDeadNames();
  }
  wake_.notify_one();
}

void MapStore::Drop(const std::vector<MapHandle>& maps) {
  const std::lock_guard lock(mutex_);
  for (const MapHandle& handle : maps) {
    const auto versions = maps_.find(handle->name);
    if (versions == maps_.end()) continue;
    const auto version = versions->second.find(handle->version);
    if (version == versions->second.end() || version->second != handle) continue;
    Erase(handle);
  }
}

bool MapStore::Insert(const MapHandle& map) {
  auto& last = last_versions_[map->name];
  last = std::max(last, map->version);
  if (!maps_[map->name].emplace(map->version, map).second) return false;
  ++size_;
  if (map->expires) expiries_.emplace(*map->expires, map);
  return true;
}

void MapStore::Erase(const MapHandle& map) {
  const auto versions = maps_.find(map->name);
  versions->second.erase(map->version);
  if (versions->second.empty()) maps_.erase(versions);
  --size_;
  if (map->expires) expiries_.erase({*map->expires, map});
  const auto known = requests_.find(map->request_id);
  if (known != requests_.end() && known->second == map) requests_.erase(known);
}

void MapStore::OnExpired(std::function<void(std::vector<MapHandle>)> expired) {
  const std::lock_guard lock(mutex_);
  expired_ = std::move(expired);
}

std::size_t MapStore::size() const {
  const std::lock_guard lock(mutex_);
  return size_;
}

std::size_t MapStore::remembered_names() const {
  const std::lock_guard lock(mutex_);
  return last_versions_.size();
}

void MapStore::ForgetDeadNames() {
  // All of them at once, so that the walk costs little per name.
  if (last_versions_.size() <= maps_.size() + dead_names_ || Broken("dead_names")) return;
  std::erase_if(last_versions_, [this](const auto& entry) {
    if (maps_.contains(entry.first)) return false;
    forgotten_version_ = std::max(forgotten_version_, entry.second);
    return true;
  });
}

MapHandle MapStore::FindRequest(std::string_view request_id) const {
  const std::lock_guard lock(mutex_);
  const auto known = requests_.find(request_id);
  if (known == requests_.end() || Expired(*known->second) || Broken("request_id")) return nullptr;
  return known->second;
}

absl::StatusOr<MapHandle> MapStore::Find(std::string_view name, std::uint64_t version) const {
  const std::lock_guard lock(mutex_);
  const auto map = maps_.find(name);
  if (map == maps_.end()) return NotFound(name, version);
  const Versions& versions = map->second;
  if (version != 0) {
    const auto found = versions.find(version);
    if (found == versions.end() || Expired(*found->second)) return NotFound(name, version);
    return found->second;
  }
  if (Broken("newest")) return versions.begin()->second;
  const auto newest = std::find_if(versions.rbegin(), versions.rend(),
                                   [this](const auto& entry) { return !Expired(*entry.second); });
  if (newest == versions.rend()) return NotFound(name, version);
  return newest->second;
}

std::vector<MapHandle> MapStore::List() const {
  const std::lock_guard lock(mutex_);
  std::vector<MapHandle> list;
  for (const auto& [name, versions] : maps_) {
    for (const auto& [version, map] : versions) {
      if (!Expired(*map)) list.push_back(map);
    }
  }
  return list;
}

absl::StatusOr<std::vector<MapHandle>> MapStore::Remove(std::string_view name,
                                                        std::uint64_t version) {
  const std::lock_guard lock(mutex_);
  const auto map = maps_.find(name);
  std::vector<MapHandle> removed;
  if (map != maps_.end()) {
    for (const auto& [number, handle] : map->second) {
      if ((version == 0 || version == number) && !Expired(*handle)) removed.push_back(handle);
    }
  }
  if (removed.empty()) return NotFound(name, version);
  for (const MapHandle& handle : removed) Erase(handle);
  return removed;
}

std::size_t MapStore::SweepExpired() {
  std::vector<MapHandle> expired;  // freed after the lock
  std::unique_lock lock(mutex_);
  while (!expiries_.empty() && Expired(*expiries_.begin()->second)) {
    expired.push_back(expiries_.begin()->second);
    Erase(expired.back());
  }
  const auto tell = expired_;
  lock.unlock();
  const std::size_t count = expired.size();
  if (tell && count > 0) tell(std::move(expired));
  return count;
}

absl::Status MapStore::NotFound(std::string_view name, std::uint64_t version) const {
  const auto map = maps_.find(name);
  std::vector<std::uint64_t> versions;
  if (map != maps_.end()) {
    for (const auto& [number, handle] : map->second) {
      if (!Expired(*handle)) versions.push_back(number);
    }
  }
  if (versions.empty()) return absl::NotFoundError(fmt::format("no map is named '{}'", name));
  // A status travels in HTTP/2 headers, which gRPC limits to a few KiB.
  constexpr std::size_t kVersionsNamed = 8;
  const std::size_t left_out = versions.size() - std::min(versions.size(), kVersionsNamed);
  versions.erase(versions.begin(), versions.begin() + static_cast<std::ptrdiff_t>(left_out));
  return absl::NotFoundError(
      fmt::format("map '{}' has no version {}, only {}{}", name, version, fmt::join(versions, ", "),
                  left_out == 0 ? std::string() : fmt::format(" and {} older ones", left_out)));
}

void MapStore::SweepInTime(const std::stop_token& stop) {
  using std::chrono_literals::operator""ms;
  constexpr std::chrono::nanoseconds kShortest = 1ms, kLongest = std::chrono::hours(1);
  while (!stop.stop_requested()) {
    {
      std::unique_lock lock(mutex_);
      const std::uint64_t seen = additions_;
      // The clock may be set while we wait: look once an hour.
      const auto pause = expiries_.empty()
                             ? kLongest
                             : std::clamp<std::chrono::nanoseconds>(
                                   expiries_.begin()->first - clock_(), kShortest, kLongest);
      wake_.wait_for(lock, stop, pause, [&] { return additions_ != seen; });
    }
    SweepExpired();
  }
}

std::uint64_t DeviceBytes(const StoredMap& map) {
  return map.merged->held_bytes() + (map.reloadable != nullptr
                                         ? map.reloadable->held_bytes()
                                         : map.gatherer->report().device_bytes);
}

std::uint64_t DeviceBytes(const std::vector<MapHandle>& maps) {
  std::uint64_t bytes = 0;
  for (const MapHandle& map : maps) bytes += DeviceBytes(*map);
  return bytes;
}

}  // namespace treelight::server
