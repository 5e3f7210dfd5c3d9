#ifndef TREELIGHT_SERVER_REQUEST_LOG_H_
#define TREELIGHT_SERVER_REQUEST_LOG_H_

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/gatherer.h"
#include "server/log_file.h"
#include "spdlog/async_logger.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {

/// What is told of one request; what does not apply stays empty and is not written.
struct RequestRecord {
  std::string request_id;  ///< the client's, else a random one
  /// "Gather". A GatherStream has one record for each batch, and one without `queries` where it
  /// ended with none.
  std::string method;
  std::string peer;
  std::string client;  ///< whose token the call has
  std::string map;
  std::uint64_t version = 0;             ///< 0: none answered
  std::optional<std::uint64_t> photons;  ///< of a build, as announced
  std::optional<std::string> source;     ///< of a rebuild: "NAME@VERSION"
  std::optional<std::uint64_t> queries;
  std::optional<std::uint64_t> batch_id;
  std::optional<std::uint32_t> k;
  /// A radius for the whole batch; infinity is written as "inf".
  std::optional<float> radius;
  bool own_radii = false;  ///< the queries have a radius each: `r` is written as "per query"
  std::optional<v1::Approximation> approximation;  ///< as asked for
  bool quantized = false;                          ///< the queries came as 16-bit offsets
  v1::FloatFormat answer_floats{};                 ///< written where it is not float32
  std::optional<v1::MergeReport> merge_report;     ///< the same as in the answer
  std::string search;                              ///< likewise
  std::uint64_t bytes_in = 0;
  std::uint64_t bytes_out = 0;
  v1::Timings timings;  ///< the same as in the answer
  /// Wall time for which it held the device, also where it failed there and `timings` has no parts
  /// of it.
  std::optional<double> device_us;
  /// Batches that the device answered in one launch with this one, itself included; its times are
  /// those of the launch.
  std::optional<std::uint64_t> launch_batches;
  /// Of a build: as asked for; once there is a map, as used.
  std::optional<v1::BuildOptions> options;
  std::string choice;                      ///< why the server chose them, where it did
  std::optional<v1::TreeStatistics> tree;  ///< that was built
  std::vector<StageTime> stages;           ///< of a build
  std::optional<std::uint64_t>
      nodes_visited;  ///< sum over the batch, where STATISTICS was asked for
  std::optional<std::uint64_t> distance_tests;
  std::string device;  ///< that it used, or would have
  bool slow = false;   ///< took longer than --slow-ms
};

/// `record` as one line of JSON without the line's end; `time` is when the request ended.
std::string ToJson(const RequestRecord& record, const absl::Status& status,
                   std::chrono::system_clock::time_point time);

/// The request log: a line of JSON for each request. Safe to call from several threads at once. A
/// thread of its own writes, and no caller waits for it: should the disk or a pipe's reader fall
/// 8192 lines behind, the oldest of them are dropped, and a line with `lines_lost` tells how many.
class RequestLog {
 public:
  /// `file` is appended to; empty: stderr. PERMISSION_DENIED: see LogFile::Open.
  static absl::StatusOr<std::unique_ptr<RequestLog>> Open(const std::string& file);

  /// Writes what is left, for at most two seconds: a reader that stands still does not hold up the
  /// end of the server.
  ~RequestLog();

  void Write(const RequestRecord& record, const absl::Status& status);

  /// Opens the file anew, after it was renamed; see LogFile::Reopen. Nothing on stderr. Lines that
  /// wait to be written may go to either.
  absl::Status Reopen();

 private:
  RequestLog() = default;

  std::shared_ptr<spdlog::details::thread_pool> writer_;
  std::shared_ptr<spdlog::async_logger> logger_;
  std::shared_ptr<LogFile> file_;  // null: stderr
  std::atomic<std::size_t> told_lost_ = 0;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_REQUEST_LOG_H_
