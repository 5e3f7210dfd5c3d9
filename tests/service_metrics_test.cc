#include <sys/socket.h>

#include <chrono>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "server/file_handle.h"
#include "tests/gated_service.h"
#include "tests/http_get.h"

// What GET /metrics says of a server that has answered.
namespace treelight::testing {
namespace {

using std::chrono_literals::operator""ms;

class ServiceMetricsTest : public GatedServiceTest {
 protected:
  ServiceMetricsTest() { options_.metrics_listen = "127.0.0.1:0"; }

  /// Samples by name and labels as written, "treelight_maps" or "a{b=\"c\"}".
  std::map<std::string, double> Scrape() {
    const std::string answer = HttpGet(server_->metrics_port(), "/metrics");
    EXPECT_EQ(answer.find("HTTP/1.1 200"), 0u) << answer.substr(0, 100);
    std::map<std::string, double> samples;
    std::istringstream lines(answer);
    for (std::string line; std::getline(lines, line);) {
      const std::size_t space = line.rfind(' ');
      if (!line.starts_with("grpc_") && !line.starts_with("treelight_")) {
        continue;
      }
      samples[line.substr(0, space)] = std::stod(line.substr(space + 1));
    }
    return samples;
  }

  /// As Scrape(), once `name` is there: a call is counted after its client has the answer.
  std::map<std::string, double> ScrapeUntil(const std::string& name) {
    std::map<std::string, double> samples;
    EXPECT_TRUE(Eventually([&] {
      samples = Scrape();
      return samples.contains(name) && samples[name] > 0;
    })) << name;
    return samples;
  }
};

constexpr const char* kGather = "treelight.v1.PhotonMapService/Gather";

std::string Labels(const std::string& method, const std::string& status) {
  return "{grpc_method=\"treelight.v1.PhotonMapService/" + method + "\",grpc_status=\"" + status +
         "\"}";
}

TEST_F(ServiceMetricsTest, CallsAreCountedByMethodAndCode) {
  StartGated();
  for (int i = 0; i < 3; ++i) {
    grpc::ClientContext context;
    v1::GatherResponse response;
    ASSERT_TRUE(Gather(context, response).ok());
  }
  grpc::ClientContext context;
  v1::GatherResponse response;
  EXPECT_FALSE(stub_->Gather(&context, MakeBatch("nosuch", {0, 0, 0}, {.k = 1}), &response).ok());
  auto samples =
      ScrapeUntil("grpc_server_call_duration_seconds_count" + Labels("Gather", "NOT_FOUND"));
  EXPECT_EQ(samples["grpc_server_call_started_total{grpc_method=\"" + std::string(kGather) + "\"}"],
            4);
  EXPECT_EQ(samples["grpc_server_call_duration_seconds_count" + Labels("Gather", "OK")], 3);
  EXPECT_EQ(samples["grpc_server_call_duration_seconds_count" + Labels("Gather", "NOT_FOUND")], 1);
  EXPECT_EQ(samples["grpc_server_call_duration_seconds_count" + Labels("BuildPhotonMap", "OK")], 1);
  EXPECT_GT(samples["grpc_server_call_duration_seconds_sum" + Labels("Gather", "OK")], 0);
  // Bytes as the log has them: the build's messages.
  std::uint64_t upload_bytes = 0;
  for (const auto& message : MakeUpload("cloud", photons_)) upload_bytes += message.ByteSizeLong();
  EXPECT_EQ(samples["grpc_server_call_rcvd_total_compressed_message_size_bytes_sum" +
                    Labels("BuildPhotonMap", "OK")],
            static_cast<double>(upload_bytes));
  EXPECT_EQ(samples["grpc_server_call_sent_total_compressed_message_size_bytes_sum" +
                    Labels("Gather", "NOT_FOUND")],
            0);
}

TEST_F(ServiceMetricsTest, GaugesFollowTheServer) {
  DeviceInfo device;
  device.memory_bytes = device.max_buffer_bytes = 1 << 30;
  options_.devices = {device};
  options_.memory_limit = 1 << 28;
  StartGated();
  const auto running = GatherAtGate();
  auto waiting = std::async(std::launch::async, [&] {
    grpc::ClientContext context;
    v1::GatherResponse response;
    return Gather(context, response);
  });
  auto samples = ScrapeUntil("treelight_device_queue_depth");
  // The build that was answered may have its end still before it.
  EXPECT_TRUE(Eventually([&] {
    samples = Scrape();
    return samples["treelight_open_calls"] == 2;
  }));
  EXPECT_EQ(samples["treelight_device_queue_depth"], 1);
  EXPECT_EQ(samples["treelight_maps"], 1);
  EXPECT_EQ(samples["treelight_photons"], 1000);
  EXPECT_EQ(samples["treelight_device_memory_bytes"], 1 << 30);
  EXPECT_EQ(samples["treelight_memory_limit_bytes"], 1 << 28);
  EXPECT_GT(samples["treelight_memory_held_bytes{holder=\"messages\"}"], 0);
  EXPECT_EQ(samples["treelight_memory_held_bytes{holder=\"uploads\"}"], 0);
  gate_->open = true;
  EXPECT_TRUE(running->status.get().ok());
  EXPECT_TRUE(waiting.get().ok());
  Delete("cloud");
  EXPECT_TRUE(Eventually([&] {
    samples = Scrape();
    return samples["treelight_open_calls"] == 0 &&
           samples["treelight_memory_held_bytes{holder=\"messages\"}"] == 0;
  }));
  EXPECT_EQ(samples["treelight_maps"], 0);
  EXPECT_EQ(samples["treelight_device_queue_depth"], 0);
}

TEST_F(ServiceMetricsTest, RefusalsAreCountedByReason) {
  options_.memory_limit = 16 << 20;
  StartGated();
  EXPECT_EQ(Scrape()["treelight_refusals_total{reason=\"builds\"}"], 0);
  auto upload = MakeUpload("large", photons_);
  upload[0].mutable_header()->set_photon_count(10'000'000);
  v1::BuildPhotonMapResponse response;
  EXPECT_FALSE(Build(*stub_, upload, response).ok());
  auto samples = ScrapeUntil("treelight_refusals_total{reason=\"memory\"}");
  EXPECT_EQ(samples["treelight_refusals_total{reason=\"memory\"}"], 1);
  for (const char* reason : {"builds", "queue", "deadline"}) {
    const std::string name = "treelight_refusals_total{reason=\"" + std::string(reason) + "\"}";
    EXPECT_TRUE(samples.contains(name)) << name;
    EXPECT_EQ(samples[name], 0) << name;
  }
}

TEST_F(ServiceMetricsTest, StagesAndSlowRequestsAreTold) {
  options_.slow = 50ms;
  StartGated();
  {
    const auto slow = GatherAtGate();
    std::this_thread::sleep_for(100ms);  // that it takes
    gate_->open = true;
    ASSERT_TRUE(slow->status.get().ok());
  }
  const std::string method = "{grpc_method=\"" + std::string(kGather) + "\"";
  auto samples = ScrapeUntil("treelight_slow_requests_total" + method + "}");
  EXPECT_EQ(samples["treelight_slow_requests_total" + method + "}"], 1);
  for (const char* stage : {"queue", "serialise"}) {
    EXPECT_EQ(
        samples["treelight_stage_duration_seconds_count" + method + ",stage=\"" + stage + "\"}"], 1)
        << stage;
  }
  const auto lines = LogByMethod();
  EXPECT_EQ(lines.at("Gather").value("slow", false), true);
  EXPECT_FALSE(lines.at("BuildPhotonMap").contains("slow"));
}

TEST_F(ServiceMetricsTest, RequestsThatComeHalfHoldUpNoScrape) {
  StartGated();
  // More than there are threads to answer, and as many as the system lets wait.
  std::vector<server::FileHandle> half;
  for (int i = 0; i < 200; ++i) {
    half.emplace_back(ConnectTo(server_->metrics_port()));
    const std::string begin = "GET /metrics HTTP/1.1\r\n";
    ASSERT_EQ(send(half.back().get(), begin.data(), begin.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(begin.size()));
  }
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_FALSE(Scrape().empty());
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(15));
}

TEST_F(ServiceMetricsTest, NoIdIsALabel) {
  StartGated();
  grpc::ClientContext context;
  context.AddMetadata("x-request-id", "frame-7");
  v1::GatherResponse response;
  ASSERT_TRUE(Gather(context, response).ok());
  ScrapeUntil("grpc_server_call_duration_seconds_count" + Labels("Gather", "OK"));
  std::set<std::string> names;
  const std::string answer = HttpGet(server_->metrics_port(), "/metrics");
  // A label ends in =" and begins after { or a comma.
  for (std::size_t end = 0; (end = answer.find("=\"", end + 1)) != std::string::npos;) {
    const std::size_t begin = answer.find_last_of("{,", end) + 1;
    names.insert(answer.substr(begin, end - begin));
  }
  names.erase("quantile");  // of what the web server says of itself
  EXPECT_EQ(names, (std::set<std::string>{"grpc_method", "grpc_status", "holder", "le", "reason",
                                          "stage"}));
  EXPECT_EQ(answer.find("frame-7"), std::string::npos);
  EXPECT_EQ(answer.find("cloud"), std::string::npos);
}

TEST_F(ServiceMetricsTest, AnAddressThatIsTakenOrRemoteIsRefused) {
  StartGated();
  server::ServerOptions second = options_;
  second.metrics_listen = "127.0.0.1:" + std::to_string(server_->metrics_port());
  EXPECT_EQ(server::Server::Start(second, MakeBruteForceBuilder()).status().code(),
            absl::StatusCode::kUnavailable);
  second.metrics_listen = "0.0.0.0:0";
  EXPECT_EQ(server::Server::Start(second, MakeBruteForceBuilder()).status().code(),
            absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace treelight::testing
