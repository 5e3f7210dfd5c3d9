#ifndef TREELIGHT_TESTS_EMULATED_WORK_GROUP_H_
#define TREELIGHT_TESTS_EMULATED_WORK_GROUP_H_

#include <cstddef>
#include <functional>

namespace treelight::emulated {

/// Runs a kernel on the calling thread, one work-group after the other: `item` once for each
/// work-item, as a fiber that is left where it calls a function of sub_group.cl until all 32 items
/// of its sub-group have called it, and at a barrier until all items of the work-group have come to
/// it. From one such call to the next, the items of a sub-group run one after the other, in an
/// order that is another one each time; so do sub-groups. Not for several threads at once.
///
/// Throws std::logic_error where items of a sub-group call different functions, or one of them ends
/// and another one calls, and likewise sub-groups at a barrier: on a device, all would wait for
/// ever.
/// @param sub_groups  of a work-group, at most 12
void RunWorkGroups(std::size_t groups, std::size_t sub_groups, const std::function<void()>& item);

}  // namespace treelight::emulated

#endif  // TREELIGHT_TESTS_EMULATED_WORK_GROUP_H_
