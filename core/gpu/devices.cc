#include "core/gpu/devices.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_split.h"
#include "absl/strings/strip.h"
#include "core/cpu/cpu_floors.h"
#include "core/cpu/simd/packed_search.h"
#include "core/device/guard.h"
#include "core/gpu/gpu_builder.h"
#include "core/gpu/gpu_floors.h"
#include "core/replicated_builder.h"
#include "fmt/format.h"

namespace treelight {
namespace {

struct FoundDevice {
  DeviceInfo info;
  std::optional<std::size_t> open_cl;  ///< place in ListOpenClDevices; none: the native CPU
};

/// What the processor calls itself.
std::string ProcessorName() {
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (!absl::StartsWith(line, "model name")) continue;
    return std::string(absl::StripAsciiWhitespace(line.substr(line.find(':') + 1)));
  }
  return "CPU";
}

DeviceInfo NativeCpu() {
  DeviceInfo info;
  info.name = fmt::format("{} ({})", ProcessorName(), NameOf(SupportedInstructions().back()));
  info.platform = kNativePlatform;
  info.driver = "TBB";
  info.type = "cpu";
  info.compute_units = std::max(1u, std::thread::hardware_concurrency());
  info.memory_bytes = static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) *
                      static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  info.max_buffer_bytes = info.memory_bytes;
  return info;
}

/// GPUs, the native CPU, then what else OpenCL has: a CPU is faster without OpenCL.
std::vector<FoundDevice> FindDevices(const DeviceOptions& options) {
  std::vector<FoundDevice> found;
  for (DeviceInfo& info : ListOpenClDevices(options)) {
    found.push_back({std::move(info), found.size()});
  }
  const auto first_other = std::find_if(found.begin(), found.end(),
                                        [](const FoundDevice& d) { return d.info.type != "gpu"; });
  found.insert(first_other, {NativeCpu(), std::nullopt});
  for (std::size_t i = 0; i < found.size(); ++i) found[i].info.index = static_cast<int>(i);
  return found;
}

bool IsNamed(const DeviceInfo& info, const std::string& wanted) {
  int index = 0;
  const char* const end = wanted.data() + wanted.size();
  const auto [parsed, error] = std::from_chars(wanted.data(), end, index);
  if (parsed == end) return error == std::errc() && info.index == index;
  return absl::StrContains(absl::AsciiStrToLower(info.name), absl::AsciiStrToLower(wanted));
}

/// The first of `devices`, which are some, or the one that `wanted` names: an index, or part of a
/// name.
absl::StatusOr<FoundDevice> Choose(std::vector<FoundDevice> devices, const std::string& wanted) {
  std::string names;
  bool any_open_cl = false;
  for (FoundDevice& device : devices) {
    if (wanted.empty() || IsNamed(device.info, wanted)) return std::move(device);
    any_open_cl |= device.open_cl.has_value();
    names +=
        fmt::format("{}{}: {}", names.empty() ? "" : ", ", device.info.index, device.info.name);
  }
  // PoCL without a folder for its kernels lists no device and says nothing.
  return absl::NotFoundError(
      fmt::format("device \"{}\" is none of those here ({}){}", wanted, names,
                  any_open_cl ? ""
                              : "; OpenCL has none: PoCL needs a folder that it can write "
                                "(--cache-dir, HOME or POCL_CACHE_DIR)"));
}

/// The devices that `wanted` names, separated by commas, at least one. NOT_FOUND: one is none of
/// those here. INVALID_ARGUMENT: of several one is named twice, or is no GPU.
absl::StatusOr<std::vector<FoundDevice>> ChooseAll(const std::vector<FoundDevice>& devices,
                                                   const std::string& wanted) {
  std::vector<FoundDevice> chosen;
  const std::vector<std::string> names = absl::StrSplit(wanted, ',');
  for (const std::string& name : names) {
    auto device = Choose(devices, std::string(absl::StripAsciiWhitespace(name)));
    if (!device.ok()) return device.status();
    const bool twice = std::ranges::any_of(
        chosen, [&](const FoundDevice& other) { return other.info.index == device->info.index; });
    if (twice) {
      return absl::InvalidArgumentError(
          fmt::format("device \"{}\": {} is named twice; say their "
                      "indices",
                      wanted, device->info.name));
    }
    chosen.push_back(*std::move(device));
  }
  for (const FoundDevice& device : chosen) {
    if (chosen.size() == 1 || device.info.type == "gpu") continue;
    return absl::InvalidArgumentError(fmt::format(
        "device \"{}\": several devices must be GPUs, {} is none", wanted, device.info.name));
  }
  return chosen;
}

}  // namespace

std::vector<DeviceInfo> ListDevices() {
  std::vector<DeviceInfo> infos;
  for (FoundDevice& device : FindDevices({})) infos.push_back(std::move(device.info));
  return infos;
}

absl::StatusOr<DeviceInfo> ChooseDevice(const DeviceOptions& options) {
  return Guard([&]() -> absl::StatusOr<DeviceInfo> {
    const auto devices = ChooseAll(FindDevices(options), options.device);
    if (!devices.ok()) return devices.status();
    DeviceInfo chosen = devices->front().info;
    for (std::size_t i = 1; i < devices->size(); ++i) {
      const DeviceInfo& other = (*devices)[i].info;
      chosen.name += " + " + other.name;
      chosen.memory_bytes = std::min(chosen.memory_bytes, other.memory_bytes);
      chosen.max_buffer_bytes = std::min(chosen.max_buffer_bytes, other.max_buffer_bytes);
    }
    return chosen;
  });
}

absl::StatusOr<std::unique_ptr<Builder>> MakeDeviceBuilder(const DeviceOptions& options) {
  return Guard([&]() -> absl::StatusOr<std::unique_ptr<Builder>> {
    const auto devices = ChooseAll(FindDevices(options), options.device);
    if (!devices.ok()) return devices.status();
    if (!devices->front().open_cl) return MakeCpuBuilder(devices->front().info.name);
    std::vector<std::unique_ptr<Builder>> builders;
    for (const FoundDevice& device : *devices) {
      builders.push_back(MakeGpuBuilder(OpenGpu(*device.open_cl, options)));
    }
    return builders.size() == 1 ? std::move(builders.front())
                                : MakeReplicatedBuilder(std::move(builders));
  });
}

absl::StatusOr<std::unique_ptr<FloorMeter>> MakeFloorMeter(const DeviceOptions& options) {
  return Guard([&]() -> absl::StatusOr<std::unique_ptr<FloorMeter>> {
    const auto devices = ChooseAll(FindDevices(options), options.device);
    if (!devices.ok()) return devices.status();
    const FoundDevice& first = devices->front();
    if (!first.open_cl) return MakeCpuFloorMeter();
    return MakeGpuFloorMeter(OpenGpu(*first.open_cl, options));
  });
}

Gpu OpenOpenClDevice(const DeviceOptions& options) {
  std::vector<FoundDevice> devices = FindDevices(options);
  std::erase_if(devices, [](const FoundDevice& device) { return !device.open_cl; });
  if (devices.empty()) {
    throw StatusError(absl::NotFoundError(
        "no OpenCL device: install a driver, or pocl-opencl-icd for the CPU, which needs a cache "
        "folder that it can write (HOME or POCL_CACHE_DIR)"));
  }
  const auto device = Choose(std::move(devices), options.device);
  if (!device.ok()) throw StatusError(device.status());
  return OpenGpu(*device->open_cl, options);
}

}  // namespace treelight
