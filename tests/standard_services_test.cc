#include "grpcpp/completion_queue.h"
#include "grpcpp/generic/generic_stub.h"
#include "tests/gated_builder.h"
#include "tests/server_fixture.h"

// The services that gRPC brings, health and reflection, which probes and tools call. Their messages
// are written by hand here: a field is a byte 8 * number + type, then what it holds.
namespace treelight::testing {
namespace {

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

  const std::shared_ptr<Gate> gate_ = std::make_shared<Gate>();
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

TEST_F(StandardServicesTest, ReflectionListsTheService) {
  // ServerReflectionRequest.list_services, which takes any text.
  const std::string answer =
      Ask("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo", {'\x3a', '\x01', '*'});
  EXPECT_NE(answer.find(kService), std::string::npos) << answer;
}

}  // namespace
}  // namespace treelight::testing
