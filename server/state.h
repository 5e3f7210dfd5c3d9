#ifndef TREELIGHT_SERVER_STATE_H_
#define TREELIGHT_SERVER_STATE_H_

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <memory>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "core/build_chooser.h"
#include "core/builder.h"
#include "core/gather_costs.h"
#include "server/active_calls.h"
#include "server/build_slots.h"
#include "server/device_queue.h"
#include "server/flood_guard.h"
#include "server/folder_mirror.h"
#include "server/map_store.h"
#include "server/memory_budget.h"
#include "server/memory_limit.h"
#include "server/metrics.h"
#include "server/open_connections.h"
#include "server/options.h"
#include "server/request_log.h"
#include "server/request_turns.h"
#include "server/snapshot_folder.h"
#include "server/stall_watch.h"
#include "server/tokens.h"
#include "server/worker.h"
#include "tbb/info.h"
#include "tbb/task_arena.h"

namespace treelight::server {

class Batch;

/// The budget that `options` give, or the machine.
inline MemoryBudget MakeMemoryBudget(const ServerOptions& options) {
  const std::uint64_t limit =
      options.memory_limit > 0 ? options.memory_limit : DefaultMemoryLimit();
  return MemoryBudget(limit, TurnBytes(limit, options.limits.max_message_bytes));
}

/// Calls of one connection that may be open at once; more wait at the client.
inline constexpr std::size_t kMaxStreams = 256;

/// As many calls again as may be open; and room for what PoCL compiles meanwhile.
inline FloodGuard::Limits MakeFloodLimits(const ServerOptions& options) {
  constexpr std::uint64_t kBytes = 256 << 20;
  return {.calls = 2 * options.max_calls, .own_calls = kMaxStreams, .bytes = kBytes};
}

/// The patience of a StallWatch that ends nobody but of too many.
inline constexpr std::chrono::hours kForEver{24 * 365};

/// What all calls share; each part guards itself.
struct State {
  State(const ServerOptions& server_options, std::unique_ptr<Builder> map_builder,
        std::unique_ptr<RequestLog> request_log, std::unique_ptr<Tokens> caller_tokens = {})
      : options(server_options),
        builder(std::move(map_builder)),
        log(std::move(request_log)),
        tokens(std::move(caller_tokens)),
        memory(MakeMemoryBudget(options)),
        build_slots(options.build_slots),
        connections(AffordableConnections(options.max_connections)),
        calls(options.max_calls),
        floods(MakeFloodLimits(options),
               [this] {
                 const auto usage = memory.usage();
                 return std::accumulate(usage.begin(), usage.end(), std::uint64_t{0});
               }),
        stalls(options.stall),
        uploads(kForEver, options.build_slots - 1, 2 * options.stall),
        idle_streams(kForEver, most_idle_streams(), options.stall),
        turns(options.stall,
              AffordableTurns(memory.limit_bytes(), options.limits.max_message_bytes)),
        device_queue(options.queue_depth) {}

  /// Runs `work` away from gRPC's threads, of which there are few: on a thread of TBB, or at once
  /// where it handles few `bytes`, less than the hop would cost.
  template <typename Work>
  void RunOnCpu(std::size_t bytes, Work work) {
    constexpr std::size_t kFewBytes = 1 << 16;
    if (bytes <= kFewBytes) {
      work();
    } else {
      cpu.enqueue(std::move(work));
    }
  }

  /// Name of the device that maps live on; empty where ServerOptions tells of none.
  std::string device_name() const {
    return options.devices.empty() ? std::string() : options.devices[options.device_index].name;
  }

  /// Streams that may wait for their next batch at once, each with room for a message: a quarter of
  /// the memory and of the calls that may be open, and two in any case.
  std::size_t most_idle_streams() const {
    const std::uint64_t by_memory = memory.room_bytes() / 4 / options.limits.max_message_bytes;
    return std::max<std::size_t>(2, std::min<std::uint64_t>(by_memory, options.max_calls / 4));
  }

  /// Whether maps lie in host memory, as they do on a CPU.
  bool maps_in_host_memory() const {
    return !options.devices.empty() && options.devices[options.device_index].type == "cpu";
  }

  const ServerOptions options;
  const std::unique_ptr<Builder> builder;      ///< used on the device queue's thread
  BuildChooser chooser{*builder};              ///< likewise
  GatherCostsOfDevice gather_costs{*builder};  ///< likewise
  const std::unique_ptr<RequestLog> log;
  const std::unique_ptr<Tokens> tokens;  ///< null: everybody may call
  const std::chrono::steady_clock::time_point started = std::chrono::steady_clock::now();
  Metrics metrics;
  MemoryBudget memory;
  BuildSlots build_slots;
  std::unique_ptr<SnapshotFolder> snapshots;  ///< of --data-dir; null: maps live in memory alone
  std::unique_ptr<FolderMirror> mirror;       ///< where there are `snapshots`
  Worker disk;  // what waits for `snapshots`; the store tells it of what expires
  MapStore store;
  OpenConnections connections;
  ActiveCalls calls;
  FloodGuard floods;
  StallWatch stalls;
  StallWatch uploads;       ///< of photons: slow ones where no slot is free
  StallWatch idle_streams;  ///< of gathers: too many hold room for batches that do not come
  RequestTurns turns;
  // As many as TBB has workers; asking for more makes it write a warning to stderr, where the log
  // may go.
  tbb::task_arena cpu{std::max(1, tbb::info::default_concurrency() - 1),
                      /*reserved_for_masters=*/0};
  std::vector<Batch*> going;  // together; of the device queue's thread
  DeviceQueue device_queue;   // its jobs use the rest
  Worker lookups;             // what waits for `mirror`; last: its jobs ask for the device
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_STATE_H_
