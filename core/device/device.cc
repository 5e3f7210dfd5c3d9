#include "core/device/device.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "absl/strings/match.h"
#include "core/device/guard.h"
#include "core/device/kernel_source.h"
#include "fmt/format.h"

namespace treelight {
namespace {

/// The part of the device's memory that is kept when it is released.
constexpr std::uint64_t kKeptShare = 16;

struct FoundDevice {
  cl::Device device;
  DeviceInfo info;
};

std::string TypeName(cl_device_type type) {
  if ((type & CL_DEVICE_TYPE_GPU) != 0) return "gpu";
  if ((type & CL_DEVICE_TYPE_CPU) != 0) return "cpu";
  return "other";
}

DeviceInfo Describe(const cl::Platform& platform, const cl::Device& device) {
  DeviceInfo info;
  info.name = device.getInfo<CL_DEVICE_NAME>();
  info.platform = platform.getInfo<CL_PLATFORM_NAME>();
  info.driver = device.getInfo<CL_DRIVER_VERSION>();
  info.type = TypeName(device.getInfo<CL_DEVICE_TYPE>());
  info.compute_units = device.getInfo<CL_DEVICE_MAX_COMPUTE_UNITS>();
  info.memory_bytes = device.getInfo<CL_DEVICE_GLOBAL_MEM_SIZE>();
  info.max_buffer_bytes = device.getInfo<CL_DEVICE_MAX_MEM_ALLOC_SIZE>();
  return info;
}

/// All devices, GPUs first, then CPUs, then others; in the loader's order within a type.
std::vector<FoundDevice> FindDevices() {
  std::vector<FoundDevice> found;
  std::vector<cl::Platform> platforms;
  try {
    cl::Platform::get(&platforms);
  } catch (const cl::Error&) {
    return found;  // the loader calls "no platform" an error
  }
  for (const cl::Platform& platform : platforms) {
    std::vector<cl::Device> devices;
    try {
      platform.getDevices(CL_DEVICE_TYPE_ALL, &devices);
    } catch (const cl::Error&) {
      continue;  // a platform without a device
    }
    for (const cl::Device& device : devices) {
      try {
        if (device.getInfo<CL_DEVICE_AVAILABLE>() == CL_FALSE) continue;
        found.push_back({device, Describe(platform, device)});
      } catch (const cl::Error&) {
        continue;  // a driver that fails must not hide the other devices
      }
    }
  }
  const auto rank = [](const FoundDevice& d) {
    return d.info.type == "gpu" ? 0 : d.info.type == "cpu" ? 1 : 2;
  };
  std::stable_sort(found.begin(), found.end(),
                   [&](const FoundDevice& a, const FoundDevice& b) { return rank(a) < rank(b); });
  for (std::size_t i = 0; i < found.size(); ++i) found[i].info.index = static_cast<int>(i);
  return found;
}

/// The cache folder that `options` names; PoCL's own cache goes into it too, unless the user has
/// placed that. To be called before the first OpenCL call: PoCL reads its variable once.
std::filesystem::path CacheDirectory(const DeviceOptions& options) {
  if (options.cache_directory.empty()) return DefaultCacheDirectory();
  setenv("POCL_CACHE_DIR", (std::filesystem::path(options.cache_directory) / "pocl").c_str(),
         /*replace=*/0);
  return options.cache_directory;
}

/// OpenCL C 3.0 where it has atomics of device scope, else 1.2, whose fences order memory across
/// work-groups on CPUs alone (see hierarchy.cl). What compiles decides: one GPU driver compiles
/// these atomics and does not list them, and its 1.2 fence holds within a work-group only, which
/// left stale boxes behind.
std::string LanguageOption(const cl::Context& context, const cl::Device& device,
                           const DeviceInfo& info) {
  const cl::Program probe(
      context,
      "kernel void probe(volatile global atomic_uint* a) {"
      "  atomic_exchange_explicit(a, 1u, memory_order_acq_rel, memory_scope_device);"
      "}");
  try {
    probe.build({device}, "-cl-std=CL3.0");
    return "-cl-std=CL3.0";
  } catch (const cl::Error&) {
    if (info.type == "cpu") return "-cl-std=CL1.2";
    throw StatusError(absl::InternalError(fmt::format(
        "device {} has no atomics of device scope (OpenCL C 3.0): trees cannot be built on it",
        info.name)));
  }
}

/// Whether the device's compiler takes the PTX of sub_group.cl (redux: compute capability 8.0).
bool HasPtx(const cl::Context& context, const cl::Device& device) {
  if (!absl::StrContains(device.getInfo<CL_DEVICE_VENDOR>(), "NVIDIA")) return false;
  const cl::Program probe(
      context,
      "kernel void probe(global uint* a) {"
      "  uint sum;"
      "  asm volatile(\"redux.sync.add.u32 %0, %1, 0xffffffff;\" : \"=r\"(sum) : \"r\"(a[0]));"
      "  a[0] = sum;"
      "}");
  try {
    probe.build({device}, "-cl-std=CL3.0");
    return true;
  } catch (const cl::Error&) {
    return false;
  }
}

}  // namespace

std::vector<DeviceInfo> ListOpenClDevices(const DeviceOptions& options) {
  (void)CacheDirectory(options);
  std::vector<DeviceInfo> infos;
  for (FoundDevice& found : FindDevices()) infos.push_back(std::move(found.info));
  return infos;
}

std::shared_ptr<Device> Device::Open(std::size_t index, const DeviceOptions& options) {
  (void)CacheDirectory(options);
  std::vector<FoundDevice> found = FindDevices();
  if (index >= found.size()) {
    throw StatusError(absl::NotFoundError(fmt::format("OpenCL has no device {}", index)));
  }
  return std::shared_ptr<Device>(
      new Device(std::move(found[index].device), std::move(found[index].info), options));
}

Device::Device(cl::Device device, DeviceInfo info, const DeviceOptions& options)
    : device_(std::move(device)),
      info_(std::move(info)),
      context_(device_),
      queue_(context_, device_, CL_QUEUE_PROFILING_ENABLE),
      memory_(std::make_shared<BufferPool>(context_, info_.memory_bytes / kKeptShare)),
      programs_(context_, device_, CacheDirectory(options)),
      build_options_(LanguageOption(context_, device_, info_)),
      local_memory_bytes_(device_.getInfo<CL_DEVICE_LOCAL_MEM_SIZE>()) {
  // Without the flag one GPU's sqrt and division miss the last bit; a device that lacks it is exact
  // or says so here.
  if ((device_.getInfo<CL_DEVICE_SINGLE_FP_CONFIG>() & CL_FP_CORRECTLY_ROUNDED_DIVIDE_SQRT) == 0) {
    throw StatusError(absl::InternalError(fmt::format(
        "device {} has no correctly rounded division: its answers would differ in the last bit",
        info_.name)));
  }
  build_options_ += " -cl-fp32-correctly-rounded-divide-sqrt";
  has_sub_groups_ = HasPtx(context_, device_);
}

cl::Program Device::Program(const std::vector<std::string_view>& files, const std::string& defines,
                            const ResidentGroups& resident) {
  std::string source(KernelSource("types.h"));
  source += KernelSource("common.cl");
  for (const std::string_view file : files) source += KernelSource(file);
  return programs_.Get(source, build_options_ + " " + defines, resident);
}

}  // namespace treelight
