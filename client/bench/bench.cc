#include "client/bench/bench.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

// Share of BenchDevice::host_bytes that may be used.
constexpr double kMemoryShare = 0.85;
// Of each photon while a set is made: position, power, and the surface that it lies on, in arrays
// that grow by doubling.
constexpr std::uint64_t kPhotonBytes = 80;
// Of each photon in a map on a CPU, until the first is built.
constexpr double kMapBytes = 100;

class Bench {
 public:
  Bench(const BenchDevice& device, const BenchListener& listener)
      : device_(device), listener_(listener) {}

  absl::Status Run(const std::vector<BenchCell>& cells) {
    for (const BenchCell& cell : cells) {
      const auto stop = stops_.find(cell.set);
      if (stop != stops_.end() && cell.photons >= stop->second) continue;
      if (auto status = Measure(cell); !status.ok()) return status;
    }
    if (!wrong_.empty()) {
      return absl::InternalError(
          fmt::format("{} figures are not reported, since their answers are "
                      "wrong; the first: {}",
                      wrong_.size(), wrong_.front()));
    }
    return measured_ ? absl::OkStatus() : last_stop_;
  }

 private:
  absl::Status Measure(const BenchCell& cell) {
    const absl::Status fits = CheckMemory(cell);
    if (!fits.ok()) return Stop(cell, fits);
    listener_.progress(
        fmt::format("{}, seed {}, {} photons", NameOf(cell.set), cell.seed, cell.photons));
    auto outcome = MeasureCell(device_, cell, listener_);
    if (absl::IsResourceExhausted(outcome.status())) return Stop(cell, outcome.status());
    if (!outcome.ok()) return outcome.status();
    measured_ = true;
    map_bytes_ = static_cast<double>(outcome->map_bytes) /
                 static_cast<double>(cell.photons * cell.subjects.size());
    std::ranges::move(outcome->wrong, std::back_inserter(wrong_));
    return absl::OkStatus();
  }

  absl::Status CheckMemory(const BenchCell& cell) const {
    if (device_.host_bytes == 0) return absl::OkStatus();
    double bytes = static_cast<double>(kPhotonBytes * cell.photons);
    std::uint64_t work_bytes = 0;
    for (const BenchSubject& subject : cell.subjects) {
      work_bytes = std::max(work_bytes, device_.builder.WorkBytes(subject.options, cell.photons));
    }
    bytes += static_cast<double>(work_bytes);
    if (device_.maps_on_host) {
      bytes += map_bytes_ * static_cast<double>(cell.photons * cell.subjects.size());
    }
    const double limit = kMemoryShare * static_cast<double>(device_.host_bytes);
    if (bytes <= limit) return absl::OkStatus();
    return absl::ResourceExhaustedError(
        fmt::format("photons, {} trees and a build take about {}, this process may use {}",
                    cell.subjects.size(), FormatBytes(bytes),
                    FormatBytes(static_cast<double>(device_.host_bytes))));
  }

  absl::Status Stop(const BenchCell& cell, const absl::Status& why) {
    stops_[cell.set] = cell.photons;
    last_stop_ = why;
    listener_.note(fmt::format("{} ends before {} photons: {}", NameOf(cell.set), cell.photons,
                               std::string(why.message())));
    return absl::OkStatus();
  }

  const BenchDevice& device_;
  const BenchListener& listener_;
  std::map<PointSet, std::uint64_t> stops_;  // as many photons are too many
  double map_bytes_ = kMapBytes;
  bool measured_ = false;
  absl::Status last_stop_;
  std::vector<std::string> wrong_;
};

}  // namespace

absl::Status RunBench(const BenchDevice& device, const BenchPlan& plan,
                      const BenchListener& listener) {
  const auto cells = MakeCells(plan);
  if (!cells.ok()) return cells.status();
  return Bench(device, listener).Run(*cells);
}

}  // namespace treelight::client
