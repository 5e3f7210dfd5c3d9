#include "client/commands/output_names.h"

#include "core/gatherer.h"

namespace treelight::client {

const std::map<std::string, std::uint32_t>& OutputNames() {
  static const std::map<std::string, std::uint32_t> names = {
      {"count", kOutputCount},           {"radius", kOutputRadius},
      {"neighbors", kOutputNeighbors},   {"density", kOutputDensity},
      {"statistics", kOutputStatistics}, {"error-bound", kOutputErrorBound}};
  return names;
}

std::uint32_t OutputMask(const std::vector<std::string>& names) {
  std::uint32_t mask = 0;
  for (const std::string& name : names) mask |= OutputNames().at(name);
  return mask;
}

}  // namespace treelight::client
