#ifndef TREELIGHT_TESTS_FAULTS_CHECKER_H_
#define TREELIGHT_TESTS_FAULTS_CHECKER_H_

#include <string>
#include <vector>

#include "tests/faults/history.h"

namespace treelight::faults {

/// A promise of docs/guarantees.md that was not kept.
struct Violation {
  std::string rule;  ///< one of the names below
  std::string text;  ///< what was seen, with times
};

/// Checks what was promised against what was seen. Empty: all was kept. The rules:
///
///   answer      a gather is what brute force gives over the photons of the version that it names
///   stale       a gather of the newest is answered by the newest that was there throughout
///   lost        what was built stays, until it is deleted, expires, or its own file is damaged
///   came back   what was deleted, or has expired, stays away
///   refused     a build that is refused leaves no map, and one that breaks the rules is refused
///   request id  builds with one request id make one map, and other requests with it are refused
///   version     no version of a name is used twice while the server runs, later ones are larger
///   held        when no call is open, none is counted and nothing is held; memory is bounded
///   life        the server starts, ends when it is told, lets open calls finish, and not else
///   folder      the data folder holds the maps that are there, and nothing else
///   trouble     no call fails by a fault of the server alone
///
/// A call whose connection broke may have been carried out, or may be until its server has ended.
/// What else is left open docs/guarantees.md says under "Not promised".
std::vector<Violation> Check(const History& history);

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_CHECKER_H_
