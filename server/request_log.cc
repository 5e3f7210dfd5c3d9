#include "server/request_log.h"

#include <cmath>
#include <future>
#include <thread>
#include <utility>

#include "fmt/chrono.h"
#include "fmt/format.h"
#include "google/protobuf/util/json_util.h"
#include "nlohmann/json.hpp"
#include "server/convert.h"
#include "server/rare_line.h"
#include "spdlog/async.h"
#include "spdlog/sinks/stdout_sinks.h"

namespace treelight::server {
namespace {

constexpr std::size_t kLinesAhead = 8192;
constexpr auto kLongestEnd = std::chrono::seconds(2);

/// ISO 8601 in UTC, with milliseconds.
std::string FormatTime(std::chrono::system_clock::time_point time) {
  const auto ms = std::chrono::floor<std::chrono::milliseconds>(time.time_since_epoch()).count();
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z",
                     fmt::gmtime(static_cast<std::time_t>(ms / 1000)), ms % 1000);
}

/// Tenths of a microsecond are all that the clock is good for.
double Rounded(double microseconds) { return std::round(10 * microseconds) / 10; }

nlohmann::ordered_json FormatRadius(float radius) {
  if (std::isfinite(radius)) return radius;
  return std::isnan(radius) ? "nan" : radius > 0 ? "inf" : "-inf";
}

/// The fields of `message` that are not 0, as photon_map.proto names them.
nlohmann::ordered_json FormatMessage(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string text;
  if (!google::protobuf::util::MessageToJsonString(message, &text, options).ok()) return {};
  return nlohmann::ordered_json::parse(text);
}

/// A name as it came, which may be all of a message: wrong ones of megabytes must not fill the
/// disk.
std::string Shortened(const std::string& name) {
  return name.size() <= kMaxNameLength ? name : name.substr(0, kMaxNameLength) + "...";
}

template <typename T>
void Set(nlohmann::ordered_json& json, const char* key, const std::optional<T>& value) {
  if (value) json[key] = *value;
}

}  // namespace

std::string ToJson(const RequestRecord& record, const absl::Status& status,
                   std::chrono::system_clock::time_point time) {
  nlohmann::ordered_json json;
  json["time"] = FormatTime(time);
  json["request_id"] = record.request_id;
  json["method"] = record.method;
  json["peer"] = record.peer;
  if (!record.client.empty()) json["client"] = record.client;
  if (!record.map.empty()) json["map"] = Shortened(record.map);
  if (record.version != 0) json["version"] = record.version;
  Set(json, "photons", record.photons);
  Set(json, "source", record.source);
  Set(json, "queries", record.queries);
  Set(json, "batch_id", record.batch_id);
  Set(json, "k", record.k);
  if (record.own_radii) {
    json["r"] = "per query";
  } else if (record.radius) {
    json["r"] = FormatRadius(*record.radius);
  }
  if (record.approximation) json["approximation"] = FormatMessage(*record.approximation);
  if (record.quantized) json["quantized"] = true;
  if (record.answer_floats == v1::FLOAT_FORMAT_HALF) json["answer_floats"] = "FLOAT_FORMAT_HALF";
  if (record.merge_report) json["merge_report"] = FormatMessage(*record.merge_report);
  if (!record.search.empty()) json["search"] = record.search;
  json["bytes_in"] = record.bytes_in;
  json["bytes_out"] = record.bytes_out;
  const v1::Timings& times = record.timings;
  json["receive_us"] = Rounded(times.receive_us());
  json["queue_us"] = Rounded(times.queue_us());
  json["upload_us"] = Rounded(times.upload_us());
  json["kernel_us"] = Rounded(times.kernel_us());
  json["download_us"] = Rounded(times.download_us());
  json["serialise_us"] = Rounded(times.serialise_us());
  json["total_us"] = Rounded(times.total_us());
  if (record.device_us) json["device_us"] = Rounded(*record.device_us);
  Set(json, "launch_batches", record.launch_batches);
  if (record.options) json["options"] = FormatMessage(*record.options);
  if (!record.choice.empty()) json["choice"] = record.choice;
  if (record.tree) json["tree"] = FormatMessage(*record.tree);
  for (const StageTime& stage : record.stages) {
    json["stages_us"][stage.stage] = Rounded(stage.microseconds);
  }
  Set(json, "nodes_visited", record.nodes_visited);
  Set(json, "distance_tests", record.distance_tests);
  if (!record.device.empty()) json["device"] = record.device;
  if (record.slow) json["slow"] = true;
  json["code"] = absl::StatusCodeToString(status.code());
  if (!status.ok()) json["message"] = std::string(status.message());
  // A byte that is no UTF-8 must not cost the line.
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

absl::StatusOr<std::unique_ptr<RequestLog>> RequestLog::Open(const std::string& file) {
  std::shared_ptr<LogFile> log_file;
  if (!file.empty()) {
    auto opened = LogFile::Open(file);
    if (!opened.ok()) return opened.status();
    log_file = *std::move(opened);
  }
  spdlog::sink_ptr sink = log_file;
  if (sink == nullptr) sink = std::make_shared<spdlog::sinks::stderr_sink_mt>();
  std::unique_ptr<RequestLog> log(new RequestLog);
  log->file_ = log_file;
  log->writer_ = std::make_shared<spdlog::details::thread_pool>(kLinesAhead, 1);
  log->logger_ = std::make_shared<spdlog::async_logger>(
      "requests", std::move(sink), log->writer_, spdlog::async_overflow_policy::overrun_oldest);
  log->logger_->set_pattern("%v");
  // The writer may outlive the log.
  log->logger_->set_error_handler([line = std::make_shared<RareLine>()](const std::string& what) {
    line->Tell(fmt::format("a line of the request log is lost: {}", what));
  });
  log->logger_->flush_on(spdlog::level::info);
  return log;
}

RequestLog::~RequestLog() {
  logger_.reset();
  std::promise<void> written;
  const std::future<void> end = written.get_future();
  // The last reference joins the writer when its queue is empty, which may be never.
  std::thread([writer = std::move(writer_), written = std::move(written)]() mutable {
    writer.reset();
    written.set_value();
  }).detach();
  end.wait_for(kLongestEnd);
}

absl::Status RequestLog::Reopen() { return file_ == nullptr ? absl::OkStatus() : file_->Reopen(); }

void RequestLog::Write(const RequestRecord& record, const absl::Status& status) {
  const auto now = std::chrono::system_clock::now();
  // Told once there is room again, or it would be lost in turn.
  if (std::size_t told = told_lost_, lost = writer_->overrun_counter();
      lost > told && writer_->queue_size() < kLinesAhead / 2 &&
      told_lost_.compare_exchange_strong(told, lost)) {
    logger_->info(R"({{"time":"{}","lines_lost":{}}})", FormatTime(now), lost - told);
  }
  logger_->info(ToJson(record, status, now));
}

}  // namespace treelight::server
