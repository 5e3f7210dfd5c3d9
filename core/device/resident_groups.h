#ifndef TREELIGHT_CORE_DEVICE_RESIDENT_GROUPS_H_
#define TREELIGHT_CORE_DEVICE_RESIDENT_GROUPS_H_

#include <string>

namespace treelight {

/// How many work-groups of a kernel are to be at work on a multiprocessor at once: the compiler
/// gives each so many registers as leave room for the others. OpenCL C has no word for it, PTX has.
struct ResidentGroups {
  std::string kernel;   ///< of fixed work-group size
  unsigned groups = 0;  ///< 0: as the compiler likes
};

/// `ptx`, the text of a program, with that directive (.minnctapersm) at the kernel; empty where the
/// text is none of PTX or has no such kernel of fixed size.
std::string WithResidentGroups(std::string ptx, const ResidentGroups& wanted);

}  // namespace treelight

#endif  // TREELIGHT_CORE_DEVICE_RESIDENT_GROUPS_H_
