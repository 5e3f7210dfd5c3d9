// The readers of photon files (an even first byte) and query files (an odd one).
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <string>

#include "client/photon_ply.h"
#include "client/query_file.h"
#include "tests/fuzz/require.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace treelight;
  if (size == 0) return 0;
  // A file that no disk sees; its name does not end in .ply, so the bytes say what it is.
  static const int file = memfd_create("input", 0);
  static const std::string path = "/proc/self/fd/" + std::to_string(file);
  fuzz::Require(ftruncate(file, 0) == 0, "the input can be written");
  fuzz::Require(pwrite(file, data + 1, size - 1, 0) == static_cast<ssize_t>(size - 1),
                "the input can be written");
  if (data[0] % 2 == 0) {
    const auto photons = client::ReadPhotonPly(path);
    if (!photons.ok()) {
      fuzz::RequireRefusal(photons.status());
      return 0;
    }
    fuzz::Require(photons->positions.size() == 3 * photons->size(), "whole positions");
    fuzz::Require(photons->powers.empty() || photons->powers.size() == 3 * photons->size(),
                  "a power for each photon");
    fuzz::Require(photons->directions.empty() || photons->directions.size() == 2 * photons->size(),
                  "a direction for each photon");
  } else {
    const auto queries = client::ReadQueryFile(path);
    if (!queries.ok()) fuzz::RequireRefusal(queries.status());
  }
  return 0;
}
