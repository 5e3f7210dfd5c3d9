#include "core/device/device.h"

#include "core/builder.h"
#include "core/device/guard.h"
#include "gtest/gtest.h"
#include "tests/answers.h"
#include "tests/clouds.h"

namespace treelight {
namespace {

TEST(DeviceTest, GpusComeFirstThenTheNativeCpu) {
  const auto devices = ListDevices();
  ASSERT_FALSE(devices.empty());
  bool cpu_seen = false;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    EXPECT_EQ(devices[i].index, static_cast<int>(i));
    EXPECT_FALSE(cpu_seen && devices[i].type == "gpu");
    const bool first_cpu = devices[i].type == "cpu" && !cpu_seen;
    EXPECT_EQ(devices[i].platform == kNativePlatform, first_cpu);
    cpu_seen = cpu_seen || devices[i].type == "cpu";
    EXPECT_GT(devices[i].memory_bytes, 0u);
    EXPECT_GT(devices[i].max_buffer_bytes, 0u);
  }
}

TEST(DeviceTest, IsChosenByIndexOrPartOfAName) {
  const DeviceInfo first = ListDevices().at(0);
  EXPECT_EQ(ChooseDevice()->name, first.name);
  EXPECT_EQ(ChooseDevice({.device = "0", .cache_directory = {}})->name, first.name);
  std::string part = first.name.substr(1, 5);
  for (char& c : part) c = static_cast<char>(std::toupper(c));
  EXPECT_EQ(ChooseDevice({.device = part, .cache_directory = {}})->name, first.name);
}

TEST(DeviceTest, TheNativeCpuAndOpenClGiveTheSameAnswers) {
  const Photons photons = MakeCloud(CloudNamed("surfaces"), 5003, /*seed=*/1);
  std::vector<std::unique_ptr<Gatherer>> maps;
  for (const DeviceInfo& device : ListDevices()) {
    auto builder =
        MakeDeviceBuilder({.device = std::to_string(device.index), .cache_directory = {}});
    ASSERT_TRUE(builder.ok()) << builder.status();
    maps.push_back(*(*builder)->Build(photons, {}));
    EXPECT_EQ(maps.back()->report().device, device.name);
  }
  ASSERT_GE(maps.size(), 2u) << "install pocl-opencl-icd";
  const GatherQueries queries{.positions = photons.positions};
  const GatherOptions options{.k = 50, .outputs = kOutputCount | kOutputRadius | kOutputNeighbors};
  const auto expected = maps[0]->Gather(queries, options);
  for (const auto& map : maps) {
    EXPECT_TRUE(SameExactAnswers(*map->Gather(queries, options), *expected));
  }
}

TEST(DeviceTest, AnUnknownDeviceIsRefusedWithThoseThereAre) {
  for (const std::string wanted : {"99", "99999999999", "no such device"}) {
    const auto status = MakeDeviceBuilder({.device = wanted, .cache_directory = {}}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
    EXPECT_NE(status.message().find("0: " + ListDevices().at(0).name), std::string::npos) << status;
  }
}

TEST(GuardTest, TranslatesWhatIsThrown) {
  const auto thrown = [](auto error) { return Guard([&]() -> absl::Status { throw error; }); };
  EXPECT_EQ(thrown(cl::Error(CL_MEM_OBJECT_ALLOCATION_FAILURE, "clCreateBuffer")).code(),
            absl::StatusCode::kResourceExhausted);
  const absl::Status internal = thrown(cl::Error(CL_INVALID_KERNEL, "clEnqueueNDRangeKernel"));
  EXPECT_EQ(internal.code(), absl::StatusCode::kInternal);
  EXPECT_EQ(internal.message(), "device failed: clEnqueueNDRangeKernel gave OpenCL error -48");
  EXPECT_EQ(thrown(std::bad_alloc()).code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(thrown(StatusError(absl::CancelledError("enough"))).message(), "enough");
}

}  // namespace
}  // namespace treelight
