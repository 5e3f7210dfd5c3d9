#include "core/gpu/scan.h"

#include <numeric>
#include <random>

#include "gtest/gtest.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

TEST(ScanTest, KernelAgreesWithReference) {
  std::mt19937 random(7);
  for (const std::size_t size : {0, 1, 2, 255, 256, 257, 2047, 2048, 2049, 5000011}) {
    std::vector<cl_uint> values(size), expected(size);
    for (cl_uint& value : values) value = random() % 1000;
    std::exclusive_scan(values.begin(), values.end(), expected.begin(), cl_uint{0});
    const auto buffer = Upload(values);
    ExclusiveScan(TestGpu(), buffer, size);
    ASSERT_EQ(buffer.Read(TestGpu().queue()), expected) << size;
  }
}

TEST(ScanTest, SumsWrapAround) {
  const auto buffer = Upload<cl_uint>({0xffffffffu, 2, 3});
  ExclusiveScan(TestGpu(), buffer, 3);
  EXPECT_EQ(buffer.Read(TestGpu().queue()), (std::vector<cl_uint>{0, 0xffffffffu, 1}));
}

}  // namespace
}  // namespace treelight
