#ifndef TREELIGHT_CORE_DEVICE_PROGRAM_CACHE_H_
#define TREELIGHT_CORE_DEVICE_PROGRAM_CACHE_H_

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/device/opencl.h"
#include "core/device/resident_groups.h"

namespace treelight {

/// Compiled programs of one device, in memory and on disk. A program is keyed by its source, its
/// options, and the device's name, version and driver. A file that cannot be read or is damaged is
/// a miss, a folder that cannot be written costs only the next start's time. Safe to use from
/// several threads at once.
class ProgramCache {
 public:
  /// `directory` is made when the first program is saved; empty: nothing is kept on disk.
  ProgramCache(cl::Context context, cl::Device device, std::filesystem::path directory);

  /// The program of `source` built with `options`; `resident` is a wish that a compiler without
  /// PTX does not hear. Throws StatusError with the compiler's log where it does not build.
  cl::Program Get(const std::string& source, const std::string& options,
                  const ResidentGroups& resident = {});

  std::uint32_t disk_hits() const;  ///< programs that came from disk
  std::uint32_t builds() const;     ///< programs that were compiled

 private:
  std::filesystem::path FileOf(const std::string& key) const;
  std::optional<cl::Program> Load(const std::string& key, const std::string& options) const;
  void Save(const std::string& key, const cl::Program& program) const;
  cl::Program Compile(const std::string& source, const std::string& options) const;
  std::optional<cl::Program> CompileAgain(const cl::Program& program, const std::string& options,
                                          const ResidentGroups& resident) const;

  cl::Context context_;
  cl::Device device_;
  std::filesystem::path directory_;
  mutable std::mutex mutex_;
  std::map<std::string, cl::Program> programs_;  // guarded by mutex_
  std::uint32_t disk_hits_ = 0;                  // guarded by mutex_
  std::uint32_t builds_ = 0;                     // guarded by mutex_
};

/// Where compiled programs are kept unless a folder is named: $XDG_CACHE_HOME/treelight, else
/// ~/.cache/treelight, else empty.
std::filesystem::path DefaultCacheDirectory();

}  // namespace treelight

#endif  // TREELIGHT_CORE_DEVICE_PROGRAM_CACHE_H_
