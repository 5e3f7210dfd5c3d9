#include "core/device/program_cache.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "core/device/guard.h"
#include "gtest/gtest.h"
#include "tests/test_device.h"

namespace treelight {
namespace {

constexpr char kSource[] = "kernel void fill(global uint* out) { out[get_global_id(0)] = VALUE; }";

class ProgramCacheTest : public testing::Test {
 protected:
  ProgramCacheTest()
      : directory_(std::filesystem::temp_directory_path() /
                   ("treelight_cache_" + std::to_string(getpid()) + "_" +
                    testing::UnitTest::GetInstance()->current_test_info()->name())) {}
  ~ProgramCacheTest() override { std::filesystem::remove_all(directory_); }

  ProgramCache Open() const {
    return {TestGpu().queue().getInfo<CL_QUEUE_CONTEXT>(), Device(), directory_};
  }
  static cl::Device Device() { return TestGpu().queue().getInfo<CL_QUEUE_DEVICE>(); }

  std::filesystem::path OnlyFile() const {
    std::filesystem::path found;
    int files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
      found = entry.path();
      ++files;
    }
    EXPECT_EQ(files, 1);
    return found;
  }

  static cl_uint Run(const cl::Program& program) {
    const Buffer<cl_uint> out(TestGpu().memory(), 1);
    Launch(TestGpu(), program, "fill", 1, 1, out.get());
    return out.Read(TestGpu().queue())[0];
  }

  const std::filesystem::path directory_;
};

TEST_F(ProgramCacheTest, IsKeptInMemoryAndOnDisk) {
  ProgramCache first = Open();
  EXPECT_EQ(Run(first.Get(kSource, "-DVALUE=5")), 5u);
  EXPECT_EQ(Run(first.Get(kSource, "-DVALUE=5")), 5u);
  EXPECT_EQ(first.builds(), 1u);
  ProgramCache second = Open();
  EXPECT_EQ(Run(second.Get(kSource, "-DVALUE=5")), 5u);
  EXPECT_EQ(second.builds(), 0u);
  EXPECT_EQ(second.disk_hits(), 1u);
}

TEST_F(ProgramCacheTest, OptionsAndSourceAreParts) {
  ProgramCache cache = Open();
  EXPECT_EQ(Run(cache.Get(kSource, "-DVALUE=5")), 5u);
  EXPECT_EQ(Run(cache.Get(kSource, "-DVALUE=6")), 6u);
  EXPECT_EQ(Run(cache.Get(std::string(kSource) + "\n", "-DVALUE=5")), 5u);
  EXPECT_EQ(cache.builds(), 3u);
}

TEST_F(ProgramCacheTest, ADamagedFileIsAMiss) {
  (void)Open().Get(kSource, "-DVALUE=5");
  const std::filesystem::path file = OnlyFile();
  const auto size = std::filesystem::file_size(file);
  const auto expect_miss = [&](const char* what) {
    ProgramCache cache = Open();
    EXPECT_EQ(Run(cache.Get(kSource, "-DVALUE=5")), 5u) << what;
    EXPECT_EQ(cache.builds(), 1u) << what;
  };
  for (const std::uintmax_t length : {std::uintmax_t{0}, std::uintmax_t{10}, size / 2, size - 1}) {
    std::filesystem::resize_file(file, length);
    expect_miss("truncated");  // and writes the file anew
    ASSERT_EQ(std::filesystem::file_size(file), size);
  }
  for (const std::uintmax_t place :
       {std::uintmax_t{0}, std::uintmax_t{9}, std::uintmax_t{20}, size - 1}) {
    {
      std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
      stream.seekg(static_cast<std::streamoff>(place));
      const int byte = stream.get();
      stream.seekp(static_cast<std::streamoff>(place));
      stream.put(static_cast<char>(byte ^ 0x40));
    }
    expect_miss("flipped");
  }
}

TEST_F(ProgramCacheTest, AFolderThatCannotBeMadeCostsOnlyTime) {
  for (const char* folder : {"/proc/none", ""}) {
    ProgramCache cache(TestGpu().queue().getInfo<CL_QUEUE_CONTEXT>(), Device(), folder);
    EXPECT_EQ(Run(cache.Get(kSource, "-DVALUE=7")), 7u);
  }
}

TEST_F(ProgramCacheTest, AnErrorShowsTheCompilersLog) {
  ProgramCache cache = Open();
  const auto status = Guard([&]() -> absl::Status {
    (void)cache.Get("kernel void broken( {", "");
    return absl::OkStatus();
  });
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
  EXPECT_NE(status.message().find("error"), std::string::npos) << status;
}

}  // namespace
}  // namespace treelight
