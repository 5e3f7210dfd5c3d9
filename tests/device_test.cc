#include "core/device/device.h"

#include "core/builder.h"
#include "core/device/guard.h"
#include "gtest/gtest.h"

namespace treelight {
namespace {

TEST(DeviceTest, GpusComeBeforeCpus) {
  const auto devices = ListDevices();
  ASSERT_FALSE(devices.empty()) << "install pocl-opencl-icd";
  bool cpu_seen = false;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    EXPECT_EQ(devices[i].index, static_cast<int>(i));
    EXPECT_FALSE(cpu_seen && devices[i].type == "gpu");
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

TEST(DeviceTest, AnUnknownDeviceIsRefusedWithThoseThereAre) {
  for (const std::string wanted : {"99", "no such device"}) {
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
