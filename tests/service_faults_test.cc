#include <new>
#include <stdexcept>
#include <vector>

#include "tests/gated_service.h"

// A device, or the host's memory, that fails: the request fails, and the server goes on.
namespace treelight::testing {
namespace {

/// What the next build or gather does.
enum class Fault { kNone, kDeviceLost, kDeviceMemory, kHostMemory, kOther };

absl::Status Fail(Fault fault) {
  switch (fault) {
    case Fault::kDeviceLost:
      return absl::InternalError("device 'made up': the device was lost");
    case Fault::kDeviceMemory:
      return absl::ResourceExhaustedError("device 'made up': its memory does not hold the map");
    case Fault::kHostMemory:
      throw std::bad_alloc();
    case Fault::kOther:
      throw std::runtime_error("made up");
    case Fault::kNone:
      break;
  }
  return absl::OkStatus();
}

class FailingGatherer final : public GatedGatherer {
 public:
  FailingGatherer(std::shared_ptr<std::atomic<Fault>> fault, std::unique_ptr<Gatherer> map)
      : GatedGatherer(std::make_shared<Gate>(), std::move(map)), fault_(std::move(fault)) {}

  absl::StatusOr<GatherResult> Gather(const GatherQueries& queries, const GatherOptions& options,
                                      const CancelCheck& cancelled) const override {
    if (auto status = Fail(*fault_); !status.ok()) return status;
    return GatedGatherer::Gather(queries, options, cancelled);
  }

 private:
  std::shared_ptr<std::atomic<Fault>> fault_;
};

class FailingBuilder final : public Builder {
 public:
  explicit FailingBuilder(std::shared_ptr<std::atomic<Fault>> fault) : fault_(std::move(fault)) {}

  absl::StatusOr<std::unique_ptr<Gatherer>> Build(const Photons& photons,
                                                  const BuildOptions& options,
                                                  const CancelCheck&) override {
    if (auto status = Fail(*fault_); !status.ok()) return status;
    auto map = MakeBruteForceBuilder()->Build(photons, options);
    if (!map.ok()) return map.status();
    return std::make_unique<FailingGatherer>(fault_, *std::move(map));
  }

 private:
  std::shared_ptr<std::atomic<Fault>> fault_;
};

struct FaultCase {
  Fault fault;
  grpc::StatusCode code;
  const char* message;
};

class ServiceFaultsTest : public ServerTest, public ::testing::WithParamInterface<FaultCase> {
 protected:
  void Check(const grpc::Status& status) {
    EXPECT_EQ(status.error_code(), GetParam().code);
    EXPECT_EQ(status.error_message(), GetParam().message);
  }

  std::uint64_t MemoryUsed() {
    v1::ServerInfo info;
    grpc::ClientContext context;
    EXPECT_TRUE(stub_->GetServerInfo(&context, {}, &info).ok());
    return info.memory_bytes_used();
  }

  const std::shared_ptr<std::atomic<Fault>> fault_ =
      std::make_shared<std::atomic<Fault>>(Fault::kNone);
};

TEST_P(ServiceFaultsTest, FailsTheRequestAndNotTheServer) {
  DeviceInfo device;
  device.type = "cpu";
  device.memory_bytes = device.max_buffer_bytes = 1 << 30;
  options_.devices = {device};
  options_.build_slots = 1;
  Start(std::make_unique<FailingBuilder>(fault_));
  const Photons photons = MakePhotons(1000, 1);
  MustBuild("cloud", photons);
  const auto batch = MakeBatch("cloud", {0, 0, 0}, {.k = 1});
  const std::uint64_t used_before = MemoryUsed();

  *fault_ = GetParam().fault;
  v1::BuildPhotonMapResponse built;
  Check(Build(*stub_, MakeUpload("lost", photons), built));
  v1::GatherResponse response;
  {
    grpc::ClientContext context;
    Check(stub_->Gather(&context, batch, &response));
  }
  std::vector<v1::GatherResponse> parts;
  Check(Stream(*stub_, {&batch, 1}, parts));

  *fault_ = Fault::kNone;
  grpc::ClientContext context;
  EXPECT_TRUE(stub_->Gather(&context, batch, &response).ok());
  EXPECT_TRUE(Eventually([&] { return MemoryUsed() == used_before; }));
  EXPECT_EQ(MustBuild("lost", photons).version(), 1u);  // and its slot is free
}

INSTANTIATE_TEST_SUITE_P(
    AllFaults, ServiceFaultsTest,
    ::testing::Values(FaultCase{Fault::kDeviceLost, grpc::StatusCode::INTERNAL,
                                "device 'made up': the device was lost"},
                      FaultCase{Fault::kDeviceMemory, grpc::StatusCode::RESOURCE_EXHAUSTED,
                                "device 'made up': its memory does not hold the map"},
                      FaultCase{Fault::kHostMemory, grpc::StatusCode::RESOURCE_EXHAUSTED,
                                "the server's memory has run out; repeat later, or ask for less"},
                      FaultCase{Fault::kOther, grpc::StatusCode::INTERNAL,
                                "the server has failed: made up"}));

}  // namespace
}  // namespace treelight::testing
