#ifndef TREELIGHT_SERVER_MAP_STORE_H_
#define TREELIGHT_SERVER_MAP_STORE_H_

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "core/builder.h"
#include "server/build_request.h"
#include "server/memory_budget.h"
#include "server/merged_maps.h"
#include "server/reloadable_map.h"

namespace treelight::server {

using TimePoint = std::chrono::system_clock::time_point;

/// One version of a map. Never changes once it is in the store.
struct StoredMap {
  std::string name;
  std::uint64_t version = 0;  ///< 0: the store gives one
  std::string request_id;     ///< of the call that built it, or empty
  BuildOptions options;
  BuildRequest request{};  ///< that has `request_id`; empty without one, or where it is not known
  std::string choice{};    ///< BuildChoice::reason, where the options were chosen here
  std::unique_ptr<const Gatherer> gatherer;
  /// `gatherer` itself, where it can leave the device and come back; else null.
  const ReloadableMap* reloadable = nullptr;
  TimePoint created;
  std::optional<TimePoint> expires;  ///< never where empty
  MemoryBudget::Share memory{};      ///< of the host, that the map holds
  std::uint64_t checksum = 0;        ///< of the head of its file, where it has one
  std::unique_ptr<MergedMaps> merged = std::make_unique<MergedMaps>();  ///< made on first use
};

/// Keeps a version alive while someone answers from it, also after the store has let go of it.
using MapHandle = std::shared_ptr<const StoredMap>;

/// All versions of all maps of this process. Safe to call from several threads at once; no call
/// waits for a device, except that the last handle of a map frees its device memory.
class MapStore {
 public:
  using Clock = std::function<TimePoint()>;

  /// `clock` tells what has expired; at most `dead_names` names without a map are remembered.
  explicit MapStore(Clock clock = std::chrono::system_clock::now, std::size_t dead_names = 65'536);

  /// Versions that are here, those of them included that have expired and were not swept yet.
  std::size_t size() const;

  /// Names whose last version is remembered, with maps or without.
  std::size_t remembered_names() const;

  /// Makes `map` visible, as the newest version of its name where it has none. Where a version with
  /// the same request id, not empty, is here already, that one is returned and `map` dropped.
  MapHandle Add(StoredMap map);

  /// A version for a map of that name that is added later; nobody else gets it.
  std::uint64_t ReserveVersion(const std::string& name);

  /// Makes visible what Remove took out, or what was built elsewhere; a version that is here stays.
  /// Also where a version with the same request id is here.
  void Restore(const std::vector<MapHandle>& maps);

  /// Lets go of these very maps, those of them that are here.
  void Drop(const std::vector<MapHandle>& maps);

  /// From now on `expired` gets the versions that have expired once the store has let go of them.
  void OnExpired(std::function<void(std::vector<MapHandle>)> expired);

  /// The version that a call with this id built, or null. An id is known as long as its version is
  /// in the store.
  MapHandle FindRequest(std::string_view request_id) const;

  /// Version 0: the newest. NOT_FOUND names the map, its newest versions, and how many
  /// more there are.
  absl::StatusOr<MapHandle> Find(std::string_view name, std::uint64_t version) const;

  /// By name, then version.
  std::vector<MapHandle> List() const;

  /// Takes one version out, or all where `version` is 0, and hands them to the caller, who frees
  /// them. NOT_FOUND as Find.
  absl::StatusOr<std::vector<MapHandle>> Remove(std::string_view name, std::uint64_t version);

  /// Lets go of what has expired; a thread of the store does so in time. Returns how many versions.
  std::size_t SweepExpired();

 private:
  using Versions = std::map<std::uint64_t, MapHandle>;

  bool Expired(const StoredMap& map) const;
  std::uint64_t NextVersion(const std::string& name);  // needs mutex_
  bool Insert(const MapHandle& map);  // needs mutex_; false where that version is here
  void Erase(const MapHandle& map);   // needs mutex_; it is here
  absl::Status NotFound(std::string_view name, std::uint64_t version) const;  // needs mutex_
  void ForgetDeadNames();                                                     // needs mutex_
  void SweepInTime(const std::stop_token& stop);

  const Clock clock_;
  const std::size_t dead_names_;
  mutable std::mutex mutex_;
  std::condition_variable_any wake_;  // with mutex_: a map that expires was added
  // Guarded by mutex_. Expired versions may still be in it until they are swept; no call shows
  // them.
  std::map<std::string, Versions, std::less<>> maps_;
  std::size_t size_ = 0;                                // guarded by mutex_: versions in maps_
  std::set<std::pair<TimePoint, MapHandle>> expiries_;  // guarded by mutex_: those that expire
  // Guarded by mutex_. Last version given to a name. Stays when the map goes, so that no version is
  // used twice; once there are too many of those, they are forgotten, and names that are not here
  // go on from the largest version forgotten.
  std::map<std::string, std::uint64_t, std::less<>> last_versions_;
  std::uint64_t forgotten_version_ = 0;  // guarded by mutex_
  // Guarded by mutex_. By request id, the versions in maps_ that have one.
  std::map<std::string, MapHandle, std::less<>> requests_;
  std::function<void(std::vector<MapHandle>)> expired_;  // guarded by mutex_
  std::uint64_t additions_ =
      0;                  // guarded by mutex_; how the sweeper knows that it has to look again
  std::jthread sweeper_;  // last: it joins before the rest goes
};

/// Device memory that `map` holds at present, bytes.
std::uint64_t DeviceBytes(const StoredMap& map);

/// Device memory that `maps` hold together, bytes.
std::uint64_t DeviceBytes(const std::vector<MapHandle>& maps);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_MAP_STORE_H_
