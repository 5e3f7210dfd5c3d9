#include "core/device/resident_groups.h"

#include "fmt/format.h"

namespace treelight {

std::string WithResidentGroups(std::string ptx, const ResidentGroups& wanted) {
  const std::size_t entry = ptx.find(fmt::format(".entry {}(", wanted.kernel));
  if (entry == std::string::npos) return {};
  const std::size_t body = ptx.find('{', entry), size = ptx.find(".reqntid", entry);
  if (body == std::string::npos || size > body) return {};
  ptx.insert(body, fmt::format(".minnctapersm {}\n", wanted.groups));
  return ptx;
}

}  // namespace treelight
