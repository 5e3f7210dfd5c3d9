#ifndef TREELIGHT_TESTS_FAULTS_HISTORY_H_
#define TREELIGHT_TESTS_FAULTS_HISTORY_H_

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/gatherer.h"
#include "core/model/photons.h"

// What was asked of a server, what it answered, and what was done to it meanwhile.
namespace treelight::faults {

/// Microseconds since the run began, of a clock that only goes forward.
using Time = std::int64_t;
inline constexpr Time kNever = std::numeric_limits<Time>::max();

/// How a call ended, as its client knows it.
enum class Outcome {
  kOk,
  kRefused,   ///< an error that says that nothing was done
  kNotFound,  ///< there is no such map
  kDataLoss,  ///< the file of the map is damaged
  kUnknown,   ///< the connection broke, or time ran out: it may have been done, or be done later
};

/// Photons that a number stands for: count and seed give the same ones again.
struct PhotonSet {
  std::uint32_t count = 0, seed = 0;
  bool operator==(const PhotonSet&) const = default;
};

/// Queries that a number stands for.
struct QuerySet {
  std::uint32_t count = 0, seed = 0, k = 0;  ///< k 0: all within `radius`
  float radius = 0;                          ///< scene units
};

/// A try to build a map. Tries with one request id ask for the same.
struct BuildTry {
  Time start = 0, end = 0;
  std::string request_id{}, name{};
  std::string
      sent_id{};  ///< not empty: it was sent with this request id, which is of another request
  PhotonSet photons{};
  Time time_to_live = 0;         ///< 0: it stays
  bool must_be_refused = false;  ///< it breaks the rules of the protocol, or a limit
  Outcome outcome = Outcome::kUnknown;
  std::string told{};  ///< message of the error
  // Of the answer.
  std::string answered_name{};
  std::uint64_t version = 0;
  std::uint64_t photon_count = 0;
  Time expires = 0;  ///< 0: never
};

struct Delete {
  Time start = 0, end = 0;
  std::string name{};
  std::uint64_t version = 0;  ///< 0: all
  Outcome outcome = Outcome::kUnknown;
  std::string told{};
};

struct Gather {
  Time start = 0, end = 0;
  std::string name{};
  std::uint64_t version = 0;  ///< that was asked for; 0: the newest
  QuerySet queries{};
  Outcome outcome = Outcome::kUnknown;
  std::string told{};
  // Of the answer.
  std::string answered_name{};
  std::uint64_t answered_version = 0;
  GatherResult result{};
};

/// A map of the list of all maps.
struct Listed {
  std::string name{};
  std::uint64_t version = 0;
  std::uint64_t photon_count = 0;
};

struct List {
  Time start = 0, end = 0;
  Outcome outcome = Outcome::kUnknown;
  std::vector<Listed> maps{};
};

/// One life of the server, from its start to its end.
struct Life {
  Time start = 0, ready = 0;    ///< ready 0: it never was
  Time end_asked = 0, end = 0;  ///< signal sent, process gone; 0: it runs still
  int signal = 0;               ///< sent to end it; 0: it ended by itself
  int exit_code = -1;           ///< -1: a signal ended it
  int ended_by = 0;             ///< that signal
  std::string told{};           ///< stderr, its last lines
};

/// Bytes of a file of a map were changed, or cut off.
struct Damage {
  Time start = 0, end = 0;
  std::string name{};
  std::uint64_t version = 0;
};

/// Something that may make calls end without a definite answer: a cut connection, a full disk.
struct Disturbance {
  Time start = 0, end = 0;
};

/// What the server held when no call had been open for a while.
struct Quiet {
  Time at = 0;
  double open_calls = 0, open_builds = 0, queue_depth = 0;
  double held_bytes = 0;      ///< by uploads, messages and answers
  double resident_bytes = 0;  ///< of the process
};

/// What the data folder holds when no call has been open for a while.
struct Folder {
  Time at = 0;
  std::vector<std::string> files{};
};

struct History {
  std::vector<BuildTry> builds{};
  std::vector<Delete> deletes{};
  std::vector<Gather> gathers{};
  std::vector<List> lists{};
  std::vector<Life> lives{};  ///< one after the other
  std::vector<Damage> damages{};
  std::vector<Disturbance> cuts, full_disks;
  std::vector<Quiet> quiets{};
  std::vector<Folder> folders{};
  double resident_limit = kNever;  ///< bytes that the process may have at most
};

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_HISTORY_H_
