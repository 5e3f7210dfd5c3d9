#include "core/replicated_builder.h"

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <future>
#include <iterator>
#include <numeric>
#include <string>
#include <utility>

#include "absl/status/status.h"

namespace treelight {
namespace {

/// Calls `work` with each number below `count`, all at once, the first on this thread. `work` must
/// not throw.
template <typename Work>
void AtOnce(std::size_t count, const Work& work) {
  std::vector<std::future<void>> others;
  for (std::size_t i = 1; i < count; ++i) {
    others.push_back(std::async(std::launch::async, [&work, i] { work(i); }));
  }
  work(0);
  for (auto& other : others) other.get();
}

/// Does `work` on each device at once. An error of one stops the others; that error, or of several
/// the first that is not CANCELLED on their account.
template <typename Work>
absl::Status OnEach(std::size_t count, const CancelCheck& cancelled, const Work& work) {
  std::atomic<bool> failed = false;
  const CancelCheck stop = [&] { return failed || (cancelled && cancelled()); };
  std::vector<absl::Status> ends(count);
  AtOnce(count, [&](std::size_t i) {
    ends[i] = work(i, stop);
    if (!ends[i].ok()) failed = true;
  });
  const auto cause = std::ranges::find_if(
      ends, [](const absl::Status& end) { return !end.ok() && !absl::IsCancelled(end); });
  if (cause != ends.end()) return *cause;
  const auto stopped = std::ranges::find_if_not(ends, &absl::Status::ok);
  return stopped == ends.end() ? absl::OkStatus() : *stopped;
}

/// The queries [first, last) of a batch.
GatherQueries Slice(const GatherQueries& queries, std::size_t first, std::size_t last) {
  const auto slice = [&](std::span<const float> array, std::size_t width) {
    return array.empty() ? array : array.subspan(width * first, width * (last - first));
  };
  return {.positions = slice(queries.positions, 3),
          .normals = slice(queries.normals, 3),
          .radii = slice(queries.radii, 1)};
}

/// Puts the answers to the parts of a batch one after the other; none has lists without a cap.
GatherResult Join(std::vector<GatherResult> parts) {
  GatherResult all = std::move(parts.front());
  const auto join = [&](auto GatherResult::*array) {
    auto& joined = all.*array;
    std::size_t size = joined.size();
    for (std::size_t i = 1; i < parts.size(); ++i) size += (parts[i].*array).size();
    joined.reserve(size);
    for (std::size_t i = 1; i < parts.size(); ++i) {
      joined.insert(joined.end(), (parts[i].*array).begin(), (parts[i].*array).end());
    }
  };
  join(&GatherResult::counts);
  join(&GatherResult::radii);
  join(&GatherResult::neighbor_ids);
  join(&GatherResult::neighbor_squared_distances);
  join(&GatherResult::densities);
  join(&GatherResult::nodes_visited);
  join(&GatherResult::distance_tests);
  join(&GatherResult::error_bounds);
  join(&GatherResult::merged);
  for (std::size_t i = 1; i < parts.size(); ++i) {
    const GatherTimes& times = parts[i].times;
    all.times.upload_us = std::max(all.times.upload_us, times.upload_us);
    all.times.kernel_us = std::max(all.times.kernel_us, times.kernel_us);
    all.times.download_us = std::max(all.times.download_us, times.download_us);
  }
  return all;
}

double StageSum(const BuildReport& report) {
  return std::accumulate(report.stages.begin(), report.stages.end(), 0.0,
                         [](double sum, const StageTime& t) { return sum + t.microseconds; });
}

class ReplicatedGatherer : public Gatherer {
 public:
  explicit ReplicatedGatherer(std::vector<std::unique_ptr<Gatherer>> maps)
      : maps_(std::move(maps)), report_(maps_.front()->report()) {
    for (std::size_t i = 1; i < maps_.size(); ++i) {
      const BuildReport& other = maps_[i]->report();
      report_.device += " + " + other.device;
      report_.device_bytes = std::max(report_.device_bytes, other.device_bytes);
      if (StageSum(other) > StageSum(report_)) report_.stages = other.stages;
    }
  }

  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override {
    // Before they are cut: the message tells places in the whole batch.
    if (auto status = CheckGather(*this, queries, options); !status.ok()) return status;
    const bool uncapped = options.k == 0 && (options.outputs & kOutputNeighbors) != 0;
    const std::size_t count =
        uncapped ? 1
                 : std::clamp<std::size_t>(queries.size() / kFewestSplitQueries, 1, maps_.size());
    if (count == 1) return maps_[turn_++ % maps_.size()]->Gather(queries, options, cancelled);
    const std::uint64_t lists = (options.outputs & kOutputNeighbors) != 0 ? options.k : 0;
    if (auto status = CheckNeighborCount(lists * queries.size(), options); !status.ok()) {
      return status;
    }
    std::vector<GatherResult> parts(count);
    const auto status = OnEach(count, cancelled, [&](std::size_t i, const CancelCheck& stop) {
      const auto part =
          Slice(queries, queries.size() * i / count, queries.size() * (i + 1) / count);
      auto result = maps_[i]->Gather(part, options, stop);
      if (result.ok()) parts[i] = *std::move(result);
      return result.status();
    });
    if (!status.ok()) return status;
    return Join(std::move(parts));
  }

  absl::StatusOr<Tree> ReadTree() const override { return maps_.front()->ReadTree(); }
  absl::StatusOr<Photons> ReadPhotons() const override { return maps_.front()->ReadPhotons(); }
  std::size_t photon_count() const override { return maps_.front()->photon_count(); }
  bool has_powers() const override { return maps_.front()->has_powers(); }
  bool has_directions() const override { return maps_.front()->has_directions(); }
  const BuildReport& report() const override { return report_; }

 private:
  const std::vector<std::unique_ptr<Gatherer>> maps_;
  BuildReport report_;
  mutable std::atomic<std::size_t> turn_ = 0;  // of batches that go to one device
};

class ReplicatedBuilder : public Builder {
 public:
  explicit ReplicatedBuilder(std::vector<std::unique_ptr<Builder>> devices)
      : devices_(std::move(devices)) {}

  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck& cancelled) override {
    std::vector<std::unique_ptr<Gatherer>> maps(devices_.size());
    const auto status =
        OnEach(devices_.size(), cancelled, [&](std::size_t i, const CancelCheck& stop) {
          auto map = devices_[i]->Build(photons, options, stop);
          if (map.ok()) maps[i] = *std::move(map);
          return map.status();
        });
    if (!status.ok()) return status;
    return std::make_unique<ReplicatedGatherer>(std::move(maps));
  }

  std::uint64_t WorkBytes(const BuildOptions& options, std::uint64_t photon_count) const override {
    return std::accumulate(devices_.begin(), devices_.end(), std::uint64_t{0},
                           [&](std::uint64_t sum, const std::unique_ptr<Builder>& device) {
                             return sum + device->WorkBytes(options, photon_count);
                           });
  }

 private:
  const std::vector<std::unique_ptr<Builder>> devices_;
};

}  // namespace

std::unique_ptr<Builder> MakeReplicatedBuilder(std::vector<std::unique_ptr<Builder>> devices) {
  return std::make_unique<ReplicatedBuilder>(std::move(devices));
}

}  // namespace treelight
