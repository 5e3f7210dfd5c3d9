#include "core/floors.h"

#include "gtest/gtest.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

class FloorsTest : public ::testing::TestWithParam<std::string> {};

TEST_P(FloorsTest, TimesGrowWithThePairs) {
  const auto meter = MakeFloorMeter({.device = GetParam(), .cache_directory = {}});
  ASSERT_TRUE(meter.ok()) << meter.status();
  ASSERT_TRUE((*meter)->Measure(1000).ok());  // the first has caches to fill
  const auto few = (*meter)->Measure(1000), many = (*meter)->Measure(1'000'000);
  ASSERT_TRUE(few.ok()) << few.status();
  ASSERT_TRUE(many.ok()) << many.status();
  EXPECT_GT(few->sort_32_us, 0);
  EXPECT_GT(many->sort_32_us, few->sort_32_us);
  EXPECT_GT(many->sort_64_us, few->sort_64_us);
  EXPECT_GT(many->copy_us, few->copy_us);
  EXPECT_EQ(many->copy_bytes, 16'000'000u);
}

TEST_P(FloorsTest, NoPairsTakeNoCopy) {
  const auto meter = MakeFloorMeter({.device = GetParam(), .cache_directory = {}});
  ASSERT_TRUE(meter.ok()) << meter.status();
  const auto floors = (*meter)->Measure(0);
  ASSERT_TRUE(floors.ok()) << floors.status();
  EXPECT_EQ(floors->copy_bytes, 0u);
}

/// The native CPU, and an OpenCL device.
std::vector<std::string> Devices() {
  std::vector<std::string> devices;
  for (const DeviceInfo& device : ListDevices()) devices.push_back(std::to_string(device.index));
  return devices;
}

INSTANTIATE_TEST_SUITE_P(Devices, FloorsTest, ::testing::ValuesIn(Devices()),
                         [](const auto& device) { return "Device" + device.param; });

TEST(FloorsTest, ADeviceThatIsNotThereIsNotFound) {
  const auto meter = MakeFloorMeter({.device = "none such", .cache_directory = {}});
  EXPECT_TRUE(absl::IsNotFound(meter.status())) << meter.status();
}

}  // namespace
}  // namespace treelight
