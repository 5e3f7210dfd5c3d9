#include "core/device/program_cache.h"

#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <system_error>
#include <utility>

#include "core/device/guard.h"
#include "fmt/format.h"
#include "xxhash.h"

namespace treelight {
namespace {

// A cache file: this header, then the device's binary.
struct FileHeader {
  char magic[8];
  std::uint64_t size;
  std::uint64_t checksum;  // XXH3 of the binary
};

constexpr char kMagic[8] = {'T', 'L', 'K', 'E', 'R', 'N', '0', '1'};

}  // namespace

ProgramCache::ProgramCache(cl::Context context, cl::Device device, std::filesystem::path directory)
    : context_(std::move(context)), device_(std::move(device)), directory_(std::move(directory)) {}

cl::Program ProgramCache::Get(const std::string& source, const std::string& options,
                              const ResidentGroups& resident) {
  const std::string identity = source + '\0' + options + '\0' + device_.getInfo<CL_DEVICE_NAME>() +
                               '\0' + device_.getInfo<CL_DEVICE_VERSION>() + '\0' +
                               device_.getInfo<CL_DRIVER_VERSION>() + '\0' + resident.kernel +
                               '\0' + std::to_string(resident.groups);
  const XXH128_hash_t hash = XXH3_128bits(identity.data(), identity.size());
  const std::string key = fmt::format("{:016x}{:016x}", hash.high64, hash.low64);

  const std::lock_guard lock(mutex_);
  if (const auto found = programs_.find(key); found != programs_.end()) return found->second;
  if (auto loaded = Load(key, options)) {
    ++disk_hits_;
    return programs_.emplace(key, *std::move(loaded)).first->second;
  }
  cl::Program program = Compile(source, options);
  ++builds_;
  if (resident.groups > 0) {
    program = CompileAgain(program, options, resident).value_or(std::move(program));
  }
  Save(key, program);
  return programs_.emplace(key, program).first->second;
}

std::uint32_t ProgramCache::disk_hits() const {
  const std::lock_guard lock(mutex_);
  return disk_hits_;
}

std::uint32_t ProgramCache::builds() const {
  const std::lock_guard lock(mutex_);
  return builds_;
}

std::filesystem::path ProgramCache::FileOf(const std::string& key) const {
  return directory_ / (key + ".clbin");
}

std::optional<cl::Program> ProgramCache::Load(const std::string& key,
                                              const std::string& options) const {
  if (directory_.empty()) return std::nullopt;
  std::ifstream file(FileOf(key), std::ios::binary);
  FileHeader header{};
  if (!file.read(reinterpret_cast<char*>(&header), sizeof header)) return std::nullopt;
  if (std::memcmp(header.magic, kMagic, sizeof kMagic) != 0) return std::nullopt;
  const std::vector<unsigned char> binary{std::istreambuf_iterator<char>(file), {}};
  if (binary.size() != header.size || XXH3_64bits(binary.data(), binary.size()) != header.checksum)
    return std::nullopt;
  try {
    cl::Program program(context_, {device_}, {binary});
    program.build({device_}, options.c_str());
    return program;
  } catch (const cl::Error&) {
    return std::nullopt;  // of another driver, say: compiled again
  }
}

void ProgramCache::Save(const std::string& key, const cl::Program& program) const {
  if (directory_.empty()) return;
  std::error_code ignored;  // without the cache everything works, only later starts take longer
  std::filesystem::create_directories(directory_, ignored);
  const auto binaries = program.getInfo<CL_PROGRAM_BINARIES>();
  if (binaries.empty() || binaries[0].empty()) return;
  FileHeader header{};
  std::memcpy(header.magic, kMagic, sizeof kMagic);
  header.size = binaries[0].size();
  header.checksum = XXH3_64bits(binaries[0].data(), binaries[0].size());
  // Written aside and renamed, so that a reader never sees half a file.
  const auto aside = directory_ / fmt::format("{}.{}.part", key, getpid());
  {
    std::ofstream file(aside, std::ios::binary);
    file.write(reinterpret_cast<const char*>(&header), sizeof header);
    file.write(reinterpret_cast<const char*>(binaries[0].data()),
               static_cast<std::streamsize>(binaries[0].size()));
    if (!file.flush()) {
      std::filesystem::remove(aside, ignored);
      return;
    }
  }
  std::filesystem::rename(aside, FileOf(key), ignored);
}

cl::Program ProgramCache::Compile(const std::string& source, const std::string& options) const {
  cl::Program program(context_, source);
  try {
    program.build({device_}, options.c_str());
  } catch (const cl::Error& error) {
    throw StatusError(
        absl::InternalError(fmt::format("kernels do not compile ({}): {}", error.err(),
                                        program.getBuildInfo<CL_PROGRAM_BUILD_LOG>(device_))));
  }
  return program;
}

std::optional<cl::Program> ProgramCache::CompileAgain(const cl::Program& program,
                                                      const std::string& options,
                                                      const ResidentGroups& resident) const {
  const auto binaries = program.getInfo<CL_PROGRAM_BINARIES>();
  if (binaries.empty()) return std::nullopt;
  const std::string ptx = WithResidentGroups({binaries[0].begin(), binaries[0].end()}, resident);
  if (ptx.empty()) return std::nullopt;
  try {
    cl::Program again(context_, {device_}, {std::vector<unsigned char>(ptx.begin(), ptx.end())});
    again.build({device_}, options.c_str());
    return again;
  } catch (const cl::Error&) {
    return std::nullopt;  // a driver that reads PTX of its own making only
  }
}

std::filesystem::path DefaultCacheDirectory() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache != nullptr && *cache != '\0') {
    return std::filesystem::path(cache) / "treelight";
  }
  if (const char* home = std::getenv("HOME"); home != nullptr && *home != '\0') {
    return std::filesystem::path(home) / ".cache" / "treelight";
  }
  return {};
}

}  // namespace treelight
