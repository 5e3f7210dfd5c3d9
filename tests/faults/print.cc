#include "tests/faults/print.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "fmt/format.h"

namespace treelight::faults {
namespace {

const char* Word(Outcome outcome) {
  switch (outcome) {
    case Outcome::kOk:
      return "ok";
    case Outcome::kRefused:
      return "refused";
    case Outcome::kNotFound:
      return "not found";
    case Outcome::kDataLoss:
      return "data loss";
    case Outcome::kUnknown:
      return "unknown";
  }
  return "";
}

class Lines {
 public:
  template <typename... Args>
  void Add(Time start, Time end, fmt::format_string<Args...> text, Args&&... args) {
    lines_.emplace_back(start,
                        fmt::format("{:10.6f} {:10.6f} {}\n", 1e-6 * static_cast<double>(start),
                                    1e-6 * static_cast<double>(end),
                                    fmt::format(text, std::forward<Args>(args)...)));
  }
  std::string Sorted() {
    std::ranges::stable_sort(lines_, {}, &std::pair<Time, std::string>::first);
    std::string text;
    for (const auto& [start, line] : lines_) text += line;
    return text;
  }

 private:
  std::vector<std::pair<Time, std::string>> lines_;
};

}  // namespace

std::string Print(const History& history) {
  Lines lines;
  for (const BuildTry& build : history.builds) {
    lines.Add(build.start, build.end, "build {} {} of {}, {} photons, ttl {} ms: {} {}@{} {}",
              build.request_id, build.sent_id, build.name, build.photons.count,
              build.time_to_live / 1000, Word(build.outcome), build.answered_name, build.version,
              build.told);
  }
  for (const Delete& gone : history.deletes) {
    lines.Add(gone.start, gone.end, "delete {}@{}: {} {}", gone.name, gone.version,
              Word(gone.outcome), gone.told);
  }
  for (const Gather& gather : history.gathers) {
    lines.Add(gather.start, gather.end, "gather {}@{}: {} {} {}", gather.name, gather.version,
              Word(gather.outcome), gather.answered_version, gather.told);
  }
  for (const List& list : history.lists) {
    std::string maps;
    for (const Listed& map : list.maps) {
      maps += fmt::format(" {}@{} {}", map.name, map.version, map.photon_count);
    }
    lines.Add(list.start, list.end, "list: {}{}", Word(list.outcome), maps);
  }
  for (const Life& life : history.lives) {
    lines.Add(life.start, life.ready, "server starts, is ready");
    if (life.end == 0) continue;
    lines.Add(life.end_asked, life.end, "server ends: signal {}, exit code {}, ended by {}",
              life.signal, life.exit_code, life.ended_by);
  }
  for (const Damage& damage : history.damages) {
    lines.Add(damage.start, damage.end, "damage to {}@{}", damage.name, damage.version);
  }
  for (const Disturbance& cut : history.cuts) lines.Add(cut.start, cut.end, "connection cut");
  for (const Disturbance& full : history.full_disks) lines.Add(full.start, full.end, "full disk");
  for (const Quiet& quiet : history.quiets) {
    lines.Add(quiet.at, quiet.at, "quiet: {} calls, {} builds, {} wait, {} bytes held, process {}",
              quiet.open_calls, quiet.open_builds, quiet.queue_depth, quiet.held_bytes,
              quiet.resident_bytes);
  }
  return lines.Sorted();
}

}  // namespace treelight::faults
