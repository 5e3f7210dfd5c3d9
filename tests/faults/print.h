#ifndef TREELIGHT_TESTS_FAULTS_PRINT_H_
#define TREELIGHT_TESTS_FAULTS_PRINT_H_

#include <string>

#include "tests/faults/history.h"

namespace treelight::faults {

/// The history as text, a line for each event, in the order of their starts.
std::string Print(const History& history);

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_PRINT_H_
