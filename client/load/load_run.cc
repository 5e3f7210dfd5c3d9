#include "client/load/load_run.h"

#include <cmath>
#include <functional>
#include <mutex>
#include <new>
#include <optional>
#include <thread>

namespace treelight::client {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kLate{1};
// What builds leave behind goes after this.
constexpr std::chrono::seconds kTimeToLive{5};
// Different points, so that no cache sees the same batch again and again.
constexpr std::size_t kBatchCount = 16;

std::vector<float> RandomNumbers(std::size_t count, std::uint32_t seed) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<float> uniform(0, 1);
  std::vector<float> numbers(count);
  for (float& number : numbers) number = uniform(engine);
  return numbers;
}

// The requests of one run, taken by the workers.
class Schedule {
 public:
  Schedule(const LoadOptions& options, Clock::time_point begin)
      : closed_(options.arrivals == Arrivals::kClosed),
        begin_(begin),
        end_(begin + options.duration),
        times_(options) {}

  // The number of the next request and when it is meant to be sent; none when the run is over.
  struct Next {
    std::uint64_t number;
    Clock::time_point intended;
  };
  std::optional<Next> Take() {
    const auto now = Clock::now();
    const std::lock_guard lock(mutex_);
    if (closed_) return now < end_ ? std::optional(Next{next_++, now}) : std::nullopt;
    const auto time = times_.Next();
    return time ? std::optional(Next{next_++, begin_ + *time}) : std::nullopt;
  }

 private:
  const bool closed_;
  const Clock::time_point begin_, end_;
  std::mutex mutex_;
  IntendedTimes times_;     // guarded by mutex_
  std::uint64_t next_ = 0;  // guarded by mutex_
};

// Sleeps until `time`; false where `interrupted` says so before.
bool SleepUntil(Clock::time_point time, const std::function<bool()>& interrupted) {
  constexpr std::chrono::milliseconds kAtMost{50};
  while (!interrupted || !interrupted()) {
    const bool last = !interrupted || Clock::now() + kAtMost >= time;
    std::this_thread::sleep_until(last ? time : Clock::now() + kAtMost);
    if (last) return true;
  }
  return false;
}

// Whether request `number` is a build: they are spread evenly.
bool IsBuild(std::uint64_t number, double share) {
  return std::floor(static_cast<double>(number + 1) * share) >
         std::floor(static_cast<double>(number) * share);
}

}  // namespace

std::uint64_t LoadResult::sent() const {
  std::uint64_t sum = 0;
  for (const KindResult& kind : kinds) sum += kind.sent;
  return sum;
}

bool LoadResult::IsSound(double fraction) const {
  return static_cast<double>(late) <= (1 - fraction) * static_cast<double>(sent());
}

std::string KindName(RequestKind kind) { return kind == RequestKind::kGather ? "gather" : "build"; }

Photons MakeLoadPhotons(std::uint64_t count, std::uint32_t seed) {
  return {.positions = RandomNumbers(3 * count, seed),
          .powers = RandomNumbers(3 * count, seed + 1),
          .directions = {}};
}

IntendedTimes::IntendedTimes(const LoadOptions& options)
    : poisson_(options.arrivals == Arrivals::kPoisson),
      rate_(options.rate),
      end_(options.arrivals == Arrivals::kClosed
               ? 0
               : std::chrono::duration<double>(options.duration).count()),
      engine_(options.seed),
      distance_(poisson_ ? rate_ : 1) {}

std::optional<std::chrono::nanoseconds> IntendedTimes::Next() {
  seconds_ = poisson_ ? seconds_ + distance_(engine_) : static_cast<double>(count_) / rate_;
  ++count_;
  if (!(seconds_ < end_)) return std::nullopt;
  return std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * seconds_));
}

LoadResult RunLoad(PhotonMapClient& client, const MapRef& map, const LoadOptions& options) {
  std::vector<std::vector<float>> batches;
  for (std::size_t i = 0; i < kBatchCount; ++i) {
    batches.push_back(RandomNumbers(3 * options.queries, options.seed + 100 + i));
  }
  const Photons photons =
      options.build_share > 0 ? MakeLoadPhotons(options.build_photons, options.seed) : Photons{};

  LoadResult result;
  std::mutex mutex;  // guards `result`
  const Clock::time_point begin = Clock::now();
  Schedule schedule(options, begin);
  const auto send = [&](std::uint64_t number, bool build) -> absl::Status {
    try {
      if (build) {
        const auto built =
            client.BuildPhotonMap(map.name + ".build", photons, {.time_to_live = kTimeToLive});
        return built.status();
      }
      return client.Gather(map, {.positions = batches[number % kBatchCount]}, options.gather)
          .status();
    } catch (const std::bad_alloc&) {
      return absl::InternalError("this machine has no memory for so many requests at once");
    }
  };
  const auto work = [&] {
    std::array<KindResult, kRequestKindCount> kinds;
    std::uint64_t late = 0;
    bool interrupted = false;
    while (const auto next = schedule.Take()) {
      interrupted = !SleepUntil(next->intended, options.interrupted);
      if (interrupted) break;
      if (Clock::now() - next->intended > kLate) ++late;
      const bool build = IsBuild(next->number, options.build_share);
      KindResult& kind =
          kinds[static_cast<std::size_t>(build ? RequestKind::kBuild : RequestKind::kGather)];
      ++kind.sent;
      const absl::Status status = send(next->number, build);
      if (status.ok()) {
        ++kind.ok;
        kind.latency.Record(Clock::now() - next->intended);
      } else if (absl::IsResourceExhausted(status)) {
        ++kind.refused;
      } else {
        ++kind.failed;
        kind.first_failure.Update(status);
      }
    }
    const std::lock_guard lock(mutex);
    result.interrupted |= interrupted;
    if (options.arrivals != Arrivals::kClosed) result.late += late;
    for (std::size_t i = 0; i < kRequestKindCount; ++i) {
      KindResult& sum = result.kinds[i];
      sum.sent += kinds[i].sent;
      sum.ok += kinds[i].ok;
      sum.refused += kinds[i].refused;
      sum.failed += kinds[i].failed;
      sum.first_failure.Update(kinds[i].first_failure);
      sum.latency.Add(kinds[i].latency);
    }
  };
  {
    std::vector<std::jthread> workers;
    for (std::uint32_t i = 0; i < options.workers; ++i) workers.emplace_back(work);
  }
  result.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  return result;
}

}  // namespace treelight::client
