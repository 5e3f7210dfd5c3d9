#ifndef TREELIGHT_CORE_DEVICE_DEVICE_H_
#define TREELIGHT_CORE_DEVICE_DEVICE_H_

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "core/builder.h"
#include "core/device/buffer_pool.h"
#include "core/device/opencl.h"
#include "core/device/program_cache.h"

namespace treelight {

/// The devices of OpenCL, GPUs first, then CPUs, then others; empty where there is none. The cache
/// folder of `options` becomes PoCL's too.
std::vector<DeviceInfo> ListOpenClDevices(const DeviceOptions& options);

/// An opened OpenCL device: context, one in-order queue with profiling, compiled programs. Knows no
/// photons. Work on the queue is for the holder of `mutex()`.
class Device {
 public:
  /// Opens device `index` of ListOpenClDevices. Throws StatusError: NOT_FOUND where there is none,
  /// INTERNAL where the device lacks what we need.
  static std::shared_ptr<Device> Open(std::size_t index, const DeviceOptions& options);

  const DeviceInfo& info() const { return info_; }
  BufferPool& memory() { return *memory_; }
  cl::CommandQueue& queue() { return queue_; }
  std::mutex& mutex() { return mutex_; }
  ProgramCache& programs() { return programs_; }

  bool is_cpu() const { return info_.type == "cpu"; }
  std::uint64_t local_memory_bytes() const { return local_memory_bytes_; }
  /// Whether kernels may use sub_group.cl.
  bool has_sub_groups() const { return has_sub_groups_; }

  /// The program of the embedded `files`, types.h and common.cl before them, built with the
  /// device's options and `defines` ("-DKEY_BITS=32"); see ProgramCache::Get.
  cl::Program Program(const std::vector<std::string_view>& files, const std::string& defines = {},
                      const ResidentGroups& resident = {});

 private:
  Device(cl::Device device, DeviceInfo info, const DeviceOptions& options);

  cl::Device device_;
  DeviceInfo info_;
  cl::Context context_;
  cl::CommandQueue queue_;
  std::shared_ptr<BufferPool> memory_;
  std::mutex mutex_;
  ProgramCache programs_;
  std::string build_options_;
  std::uint64_t local_memory_bytes_ = 0;
  bool has_sub_groups_ = false;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_DEVICE_DEVICE_H_
