#include "core/device/buffer_pool.h"

#include <algorithm>

#include "gtest/gtest.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

std::shared_ptr<BufferPool> MakePool(std::uint64_t kept_bytes) {
  return std::make_shared<BufferPool>(TestGpu().queue().getInfo<CL_QUEUE_CONTEXT>(), kept_bytes);
}

TEST(BufferPoolTest, ReleasedMemoryIsTakenAgain) {
  const auto pool = MakePool(1 << 20);
  const cl_mem first = (*pool->Take(1000))();
  EXPECT_EQ((*pool->Take(1000))(), first);
  EXPECT_EQ((*pool->Take(1020))(), first);  // of the same rounded size
  const auto held = pool->Take(1000);
  EXPECT_EQ((*held)(), first);
  EXPECT_NE((*pool->Take(1000))(), first);
}

TEST(BufferPoolTest, SizesAreRoundedUpByAnEighthAtMost) {
  const auto pool = MakePool(0);
  for (const std::size_t bytes : {1ul, 255ul, 256ul, 257ul, 4097ul, 65537ul, 1234567ul}) {
    const std::size_t size = pool->Take(bytes)->getInfo<CL_MEM_SIZE>();
    EXPECT_GE(size, bytes);
    EXPECT_LE(size, std::max<std::size_t>(bytes + bytes / 8, bytes + 256)) << bytes;
  }
}

TEST(BufferPoolTest, NoMoreThanTheLimitIsKept) {
  const auto pool = MakePool(3000);
  auto a = pool->Take(2048), b = pool->Take(2048);
  cl::Buffer b_memory = *b;  // another reference tells whether the pool still has one
  a.reset();
  b.reset();
  EXPECT_EQ(b_memory.getInfo<CL_MEM_REFERENCE_COUNT>(), 1u);
}

TEST(BufferPoolTest, MemoryOutlivesThePool) {
  auto pool = MakePool(1 << 20);
  auto buffer = pool->Take(4);
  pool.reset();
  const cl_uint value = 7;
  cl_uint read = 0;
  TestGpu().queue().enqueueWriteBuffer(*buffer, CL_TRUE, 0, sizeof value, &value);
  TestGpu().queue().enqueueReadBuffer(*buffer, CL_TRUE, 0, sizeof read, &read);
  EXPECT_EQ(read, value);
  buffer.reset();
}

}  // namespace
}  // namespace treelight
