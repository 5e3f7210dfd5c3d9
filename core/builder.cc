#include "core/builder.h"

#include <cmath>

#include "absl/status/status.h"
#include "fmt/format.h"

namespace treelight {
namespace {

absl::Status CheckLength(const char* field, std::size_t length, std::size_t expected) {
  if (length == 0 || length == expected) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{}: {} numbers, expected {} or none", field, length, expected));
}

}  // namespace

absl::Status CheckBuild(const Photons& photons, const BuildOptions& options) {
  if (photons.positions.size() % 3 != 0) {
    return absl::InvalidArgumentError(
        fmt::format("positions: {} numbers are no multiple of 3", photons.positions.size()));
  }
  for (const absl::Status& status :
       {CheckLength("powers", photons.powers.size(), 3 * photons.size()),
        CheckLength("directions", photons.directions.size(), 2 * photons.size())}) {
    if (!status.ok()) return status;
  }
  if (photons.size() >= kLeafBit) {
    return absl::ResourceExhaustedError(
        fmt::format("photons: {}, a map holds at most {}", photons.size(), kLeafBit - 1));
  }
  for (std::size_t i = 0; i < photons.positions.size(); ++i) {
    if (!(std::fabs(photons.positions[i]) <= kMaxCoordinate)) {  // also catches NaN
      return absl::InvalidArgumentError(
          fmt::format("positions[{}] of photon {} is {}, it must be finite and within {:g}", i,
                      i / 3, photons.positions[i], kMaxCoordinate));
    }
  }
  for (std::size_t i = 0; i < photons.powers.size(); ++i) {
    if (!std::isfinite(photons.powers[i])) {
      return absl::InvalidArgumentError(fmt::format(
          "powers[{}] of photon {} is {}, it must be finite", i, i / 3, photons.powers[i]));
    }
  }
  if (options.max_leaf_size < 1 || options.max_leaf_size > kMaxLeafSize) {
    return absl::InvalidArgumentError(fmt::format("max_leaf_size is {}, it must be in [1, {}]",
                                                  options.max_leaf_size, kMaxLeafSize));
  }
  if (options.morton_bits != MortonBits::k30 && options.morton_bits != MortonBits::k63) {
    return absl::InvalidArgumentError(fmt::format("morton_bits is {}, it must be 30 or 63",
                                                  static_cast<std::uint32_t>(options.morton_bits)));
  }
  return absl::OkStatus();
}

}  // namespace treelight
