#include <atomic>
#include <future>

#include "grpc/health/v1/health.grpc.pb.h"
#include "grpcpp/completion_queue.h"
#include "grpcpp/generic/generic_stub.h"
#include "tests/gated_builder.h"
#include "tests/server_fixture.h"

// Health and reflection, which probes and tools call. What they send is written by hand here, so
// that our health.proto proves nothing to itself: a field is a byte 8 * number + type, then what it
// holds.
namespace treelight::testing {
namespace {

using HealthRequest = grpc::health::v1::HealthCheckRequest;
using HealthResponse = grpc::health::v1::HealthCheckResponse;

constexpr std::string_view kService = "treelight.v1.PhotonMapService";

class StandardServicesTest : public ServerTest {
 protected:
  StandardServicesTest() { Start(std::make_unique<GatedBuilder>(gate_)); }

  /// Sends one message on a call of its own and returns the first of the answer, empty where there
  /// is none. Any method looks like a stream to this client.
  std::string Ask(const std::string& method, const std::string& message) {
    grpc::GenericStub stub(server_->InProcessChannel());
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(10));
    grpc::CompletionQueue queue;
    const auto wait = [&] {
      void* tag = nullptr;
      bool ok = false;
      return queue.Next(&tag, &ok) && ok;
    };
    const auto call = stub.PrepareCall(&context, method, &queue);
    call->StartCall(nullptr);
    wait();
    const grpc::Slice slice(message);
    call->WriteLast(grpc::ByteBuffer(&slice, 1), {}, nullptr);
    wait();
    grpc::ByteBuffer answer;
    call->Read(&answer, nullptr);
    std::string text;
    std::vector<grpc::Slice> slices;
    if (wait() && answer.Dump(&slices).ok()) {
      for (const auto& part : slices) text.append(part.begin(), part.end());
    }
    grpc::Status status;
    call->Finish(&status, nullptr);
    wait();
    EXPECT_TRUE(status.ok()) << status.error_message();
    queue.Shutdown();
    while (wait()) {
    }
    return text;
  }

  /// ServingStatus of `service`; the whole server's where empty. 1: SERVING, 2: NOT_SERVING.
  int Health(std::string_view service) {
    std::string request;
    if (!service.empty()) {
      request = {'\x0a', static_cast<char>(service.size())};  // HealthCheckRequest.service
      request += service;
    }
    const std::string answer = Ask("/grpc.health.v1.Health/Check", request);
    return answer.size() == 2 && answer[0] == '\x08' ? answer[1] : -1;
  }

  /// How a Check of `service` ends.
  grpc::Status Check(const std::string& service) {
    grpc::ClientContext context;
    HealthRequest request;
    request.set_service(service);
    HealthResponse response;
    return health().Check(&context, request, &response);
  }

  grpc::health::v1::Health::Stub& health() {
    if (health_ == nullptr) {
      health_ = grpc::health::v1::Health::NewStub(server_->InProcessChannel());
    }
    return *health_;
  }

  const std::shared_ptr<Gate> gate_ = std::make_shared<Gate>();

 private:
  std::unique_ptr<grpc::health::v1::Health::Stub> health_;
};

/// A Watch call.
class Watcher {
 public:
  Watcher(grpc::health::v1::Health::Stub& stub, std::string_view service) {
    context_.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
    HealthRequest request;
    request.set_service(std::string(service));
    reader_ = stub.Watch(&context_, request);
  }

  /// Waits for the next status; UNKNOWN, which no server says, where the call ends.
  HealthResponse::ServingStatus Next() {
    HealthResponse response;
    return reader_->Read(&response) ? response.status() : HealthResponse::UNKNOWN;
  }

  grpc::StatusCode End() { return reader_->Finish().error_code(); }

 private:
  grpc::ClientContext context_;
  std::unique_ptr<grpc::ClientReader<HealthResponse>> reader_;
};

TEST_F(StandardServicesTest, HealthServesUntilTheDrainBegins) {
  EXPECT_EQ(Health(""), 1);
  EXPECT_EQ(Health(kService), 1);

  // A gather behind the gate keeps the drain from its end.
  MustBuild("cloud", MakePhotons(10, 1));
  gate_->open = false;
  std::jthread call([&] {
    grpc::ClientContext context;
    v1::GatherResponse response;
    EXPECT_TRUE(stub_->Gather(&context, MakeBatch("cloud", {0, 0, 0}, {.k = 1}), &response).ok());
  });
  ASSERT_TRUE(Eventually([&] { return gate_->gathers == 1; }));
  std::jthread drain(
      [&] { server_->Drain(std::chrono::system_clock::now() + std::chrono::seconds(30)); });
  EXPECT_TRUE(Eventually([&] { return Health(kService) == 2; }));
  EXPECT_EQ(Health(""), 2);
  gate_->open = true;
}

TEST_F(StandardServicesTest, HealthOfAnotherServiceIsNotFound) {
  const auto status = Check("treelight.v2.PhotonMapService");
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_NE(status.error_message().find("'treelight.v2.PhotonMapService'"), std::string::npos)
      << status.error_message();
}

TEST_F(StandardServicesTest, HealthRefusesARequestThatIsTooLong) {
  EXPECT_EQ(Check(std::string(1021, 'x')).error_code(), grpc::StatusCode::NOT_FOUND);  // 1024 B
  const auto status = Check(std::string(1022, 'x'));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_NE(status.error_message().find("1025 bytes"), std::string::npos) << status.error_message();
}

TEST_F(StandardServicesTest, WatchTellsOfTheDrainAndEndsWithTheServer) {
  Watcher server(health(), ""), service(health(), kService), other(health(), "another");
  EXPECT_EQ(server.Next(), HealthResponse::SERVING);
  EXPECT_EQ(service.Next(), HealthResponse::SERVING);
  EXPECT_EQ(other.Next(), HealthResponse::SERVICE_UNKNOWN);
  server_->AnnounceEnd();
  EXPECT_EQ(server.Next(), HealthResponse::NOT_SERVING);
  EXPECT_EQ(service.Next(), HealthResponse::NOT_SERVING);
  server_->AnnounceEnd();  // nothing new
  auto others = std::async(std::launch::async, [&] { return other.Next(); });
  EXPECT_EQ(others.wait_for(std::chrono::milliseconds(100)), std::future_status::timeout);

  EXPECT_EQ(server_->Drain(std::chrono::system_clock::now()), 0u);
  EXPECT_EQ(others.get(), HealthResponse::UNKNOWN);
  EXPECT_EQ(server.Next(), HealthResponse::UNKNOWN);
  for (Watcher* const watcher : {&server, &service, &other}) {
    EXPECT_NE(watcher->End(), grpc::StatusCode::OK);
  }
}

TEST_F(StandardServicesTest, ProbesThatComeAtOnceAreAllAnswered) {
  std::vector<std::jthread> probes;
  std::atomic<int> served = 0;
  health();
  for (int i = 0; i < 32; ++i) {
    probes.emplace_back([&] {
      for (int j = 0; j < 20; ++j) served += Check("").ok() ? 1 : 0;
    });
  }
  probes.clear();
  EXPECT_EQ(served, 32 * 20);
}

TEST_F(StandardServicesTest, ReflectionListsTheService) {
  // ServerReflectionRequest.list_services, which takes any text.
  const std::string answer =
      Ask("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", {'\x3a', '\x01', '*'});
  EXPECT_NE(answer.find(kService), std::string::npos) << answer;
}

}  // namespace
}  // namespace treelight::testing
