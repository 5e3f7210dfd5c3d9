#include "tests/faults/checker.h"

#include <algorithm>
#include <charconv>
#include <utility>

#include "fmt/format.h"
#include "tests/faults/known_maps.h"

namespace treelight::faults {
namespace {

std::string Name(const KnownMap& map) { return fmt::format("{}@{}", map.name, map.version); }

std::string Span(Time start, Time end) {
  return fmt::format("[{:.3f} s, {:.3f} s]", 1e-6 * static_cast<double>(start),
                     1e-6 * static_cast<double>(end));
}

std::string Asked(const Gather& gather) {
  const std::string version =
      gather.version == 0 ? std::string("newest") : std::to_string(gather.version);
  return fmt::format("gather of {}@{} in {}", gather.name, version, Span(gather.start, gather.end));
}

std::string Story(const KnownMap& map) {
  return fmt::format("{}, {} photons, built in {}", Name(map), map.request->photons.count,
                     Span(map.born_from, map.known_by));
}

/// One run of the rules over one history.
class Judge {
 public:
  explicit Judge(const History& history) : history_(history), maps_(history) {}

  std::vector<Violation> Run() {
    constexpr std::size_t kEnough = 50;  // each is explained, which takes time
    for (const Gather& gather : history_.gathers) {
      if (violations_.size() < kEnough) CheckGather(gather);
    }
    for (const List& list : history_.lists) CheckList(list);
    for (const Delete& gone : history_.deletes) CheckDelete(gone);
    for (const BuildTry& build : history_.builds) CheckBuild(build);
    for (const auto& [id, request] : maps_.requests()) CheckRequest(id, request);
    CheckVersions();
    for (const Quiet& quiet : history_.quiets) CheckQuiet(quiet);
    for (const Life& life : history_.lives) CheckLife(life);
    for (const Folder& folder : history_.folders) CheckFolder(folder);
    return std::move(violations_);
  }

 private:
  template <typename... Args>
  void Say(const char* rule, fmt::format_string<Args...> text, Args&&... args) {
    violations_.push_back({rule, fmt::format(text, std::forward<Args>(args)...)});
  }

  void CheckGather(const Gather& gather) {
    switch (gather.outcome) {
      case Outcome::kOk:
        return CheckAnswer(gather);
      case Outcome::kNotFound:
        // Not promised: that a gather finishes whose map is deleted while it comes back.
        if (gather.version == 0 && gather.told.find("it is gone") != std::string::npos &&
            SomethingGoes(gather)) {
          return;
        }
        return ExpectNone(gather.name, gather.version, gather.start, gather.end, Asked(gather));
      case Outcome::kDataLoss:
        return CheckDataLoss(gather);
      case Outcome::kRefused:
        return CheckTrouble(gather, Asked(gather));
      case Outcome::kUnknown:
        return;
    }
  }

  /// Whether a version of the map may have gone meanwhile.
  bool SomethingGoes(const Gather& gather) const {
    return std::ranges::any_of(maps_.Named(gather.name), [&](const KnownMap* map) {
      return std::ranges::any_of(map->removals, [&](const Removal& removal) {
        return removal.from <= gather.end && removal.to >= gather.start;
      });
    });
  }

  void CheckAnswer(const Gather& gather) {
    if (gather.answered_name != gather.name ||
        (gather.version != 0 && gather.answered_version != gather.version)) {
      return Say("answer", "{} is answered by {}@{}", Asked(gather), gather.answered_name,
                 gather.answered_version);
    }
    const KnownMap* const map = maps_.Answering(gather);
    if (map == nullptr) return ExplainWrongAnswer(gather);
    if (map->GoneBy() <= gather.start) {
      if (maps_.MayBeAnother(*map, gather)) return;
      return Say("came back", "{}: it was gone by {:.3f} s, {}", Asked(gather),
                 1e-6 * static_cast<double>(map->GoneBy()), Story(*map));
    }
    if (gather.version != 0) return;
    for (const KnownMap* newer : maps_.Named(gather.name)) {
      if (newer->version > map->version && newer->CertainlyThere(gather.start, gather.end)) {
        return Say("stale", "{} is answered by version {}, and there was {}", Asked(gather),
                   map->version, Story(*newer));
      }
    }
  }

  void ExplainWrongAnswer(const Gather& gather) {
    for (const auto& [id, request] : maps_.requests()) {
      const bool early = request.tries.front()->start >= gather.end;
      if (request.name != gather.name || early || !maps_.Explains(request, gather)) continue;
      const BuildTry& build = *request.tries.front();
      if (build.outcome == Outcome::kRefused) {
        return Say("refused", "{}: answered by what was refused in {}: {}", Asked(gather),
                   Span(build.start, build.end), build.told);
      }
      return Say("answer", "{}: it says version {} and is answered by the photons of {}",
                 Asked(gather), gather.answered_version, build.version);
    }
    Say("answer", "{}: not what brute force gives for version {}", Asked(gather),
        gather.answered_version);
  }

  /// A call that nothing disturbed does not fail by the server's own doing.
  template <typename Call>
  void CheckTrouble(const Call& call, const std::string& asked) {
    if (!call.told.starts_with("INTERNAL") || maps_.Disturbed(call.start, call.end)) return;
    const bool full_disk = std::ranges::any_of(history_.full_disks, [&](const auto& full) {
      return full.start <= call.end && call.start <= full.end;
    });
    if (!full_disk) Say("trouble", "{}: {}", asked, call.told);
  }

  /// Nothing that was there throughout may be said to be missing.
  void ExpectNone(const std::string& name, std::uint64_t version, Time start, Time end,
                  const std::string& asked) {
    for (const KnownMap* map : maps_.Named(name)) {
      if ((version == 0 || version == map->version) && map->CertainlyThere(start, end)) {
        return Say("lost", "{} finds nothing; there was {}", asked, Story(*map));
      }
    }
  }

  void CheckDataLoss(const Gather& gather) {
    const bool damaged = std::ranges::any_of(history_.damages, [&](const Damage& damage) {
      return damage.name == gather.name && damage.start < gather.end &&
             (gather.version == 0 || gather.version == damage.version);
    });
    if (!damaged) Say("lost", "{}: {}", Asked(gather), gather.told);
  }

  void CheckList(const List& list) {
    if (list.outcome != Outcome::kOk) return;
    const std::string asked = fmt::format("list in {}", Span(list.start, list.end));
    for (std::size_t i = 0; i < list.maps.size(); ++i) {
      const Listed& listed = list.maps[i];
      const KnownMap* const map = maps_.Matching(list, i);
      if (map == nullptr) {
        Say("refused", "{}: nobody built {}@{} with {} photons", asked, listed.name, listed.version,
            listed.photon_count);
      } else if (map->GoneBy() <= list.start && !maps_.MayBeAnother(*map, list, listed)) {
        Say("came back", "{}: {} was gone by {:.3f} s", asked, Story(*map),
            1e-6 * static_cast<double>(map->GoneBy()));
      }
    }
    for (const KnownMap& map : maps_.all()) {
      if (!map.CertainlyThere(list.start, list.end)) continue;
      const bool told = std::ranges::any_of(list.maps, [&](const Listed& listed) {
        return listed.name == map.name && listed.version == map.version;
      });
      if (!told) Say("lost", "{} does not have {}", asked, Story(map));
    }
  }

  void CheckDelete(const Delete& gone) {
    if (gone.outcome != Outcome::kNotFound) return;
    ExpectNone(
        gone.name, gone.version, gone.start, gone.end,
        fmt::format("delete of {}@{} in {}", gone.name, gone.version, Span(gone.start, gone.end)));
  }

  void CheckBuild(const BuildTry& build) {
    const std::string asked =
        fmt::format("build of {} in {}", build.name, Span(build.start, build.end));
    if (build.must_be_refused) {
      if (build.outcome == Outcome::kOk) Say("refused", "{}: it was not refused", asked);
      return;
    }
    if (build.outcome == Outcome::kOk &&
        (build.answered_name != build.name || build.photon_count != build.photons.count)) {
      Say("request id", "{} with {} photons is answered by {}@{} with {}", asked,
          build.photons.count, build.answered_name, build.version, build.photon_count);
    }
    if (build.outcome == Outcome::kOk && !build.sent_id.empty()) CheckTakenId(build, asked);
    if (build.outcome == Outcome::kNotFound || build.outcome == Outcome::kDataLoss) {
      Say("trouble", "{}: {}", asked, build.told);
    }
    CheckTrouble(build, asked);
  }

  /// What is answered with the id of another request was asked for when no map had that any more.
  void CheckTakenId(const BuildTry& build, const std::string& asked) {
    const auto owner = maps_.requests().find(build.sent_id);
    if (owner == maps_.requests().end()) return;
    for (const KnownMap* map : maps_.Named(owner->second.name)) {
      if (map->request == &owner->second && map->CertainlyThere(build.start, build.end)) {
        Say("request id", "{} with the id of {} is answered", asked, Story(*map));
      }
    }
  }

  /// Two maps of one request are fine where the first had gone before the second came.
  void CheckRequest(const std::string& id, const Request& request) {
    std::vector<const KnownMap*> made;
    for (const KnownMap* map : maps_.Named(request.name)) {
      if (map->request == &request) made.push_back(map);
    }
    for (const KnownMap* a : made) {
      for (const KnownMap* b : made) {
        if (a->version >= b->version) continue;
        const Time both = std::max(a->known_by, b->known_by);
        const KnownMap& first = a->known_by <= b->known_by ? *a : *b;
        if (first.CertainlyThere(both, both)) {
          Say("request id", "request {} made {} and {}", id, Story(*a), Story(*b));
        }
      }
    }
  }

  /// Whether a life of the server ended after `first` and before `last`.
  bool LifeEndsIn(Time first, Time last) const {
    return std::ranges::any_of(history_.lives, [&](const Life& life) {
      return life.end != 0 && life.end >= first && life.end <= last;
    });
  }

  void CheckVersions() {
    for (const KnownMap& earlier : maps_.all()) {
      for (const KnownMap* later : maps_.Named(earlier.name)) {
        if (&earlier == later || later->known_by < earlier.known_by) continue;
        const bool twice = earlier.version == later->version;
        const bool backwards =
            earlier.version > later->version && earlier.known_by < later->born_from;
        if (!twice && !backwards) continue;
        // A new life may use again what is gone.
        if (LifeEndsIn(earlier.born_from, later->known_by) &&
            !earlier.CertainlyThere(later->known_by, later->known_by)) {
          continue;
        }
        Say("version", "{} came after {}", Story(*later), Story(earlier));
      }
    }
  }

  void CheckQuiet(const Quiet& quiet) {
    const double at = 1e-6 * static_cast<double>(quiet.at);
    if (quiet.open_calls + quiet.open_builds + quiet.queue_depth + quiet.held_bytes > 0) {
      Say("held",
          "at {:.3f} s no client asks, and {} calls are open, {} builds, {} requests wait, "
          "{} bytes are held",
          at, quiet.open_calls, quiet.open_builds, quiet.queue_depth, quiet.held_bytes);
    }
    if (quiet.resident_bytes > history_.resident_limit) {
      Say("held", "at {:.3f} s the process has {} bytes, the limit is {}", at, quiet.resident_bytes,
          history_.resident_limit);
    }
  }

  void CheckLife(const Life& life) {
    const double start = 1e-6 * static_cast<double>(life.start);
    if (life.ready == 0) {
      return Say("life", "the server of {:.3f} s does not start: {}", start, life.told);
    }
    if (life.end == 0) return;
    const std::string end = life.exit_code >= 0 ? fmt::format("exit code {}", life.exit_code)
                                                : fmt::format("signal {}", life.ended_by);
    constexpr int kKill = 9, kTerminate = 15;
    const bool as_told = (life.signal == kKill && life.ended_by == kKill) ||
                         (life.signal == kTerminate && life.exit_code == 0);
    if (!as_told) {
      Say("life", "the server of {:.3f} s was sent {} and ended with {}: {}", start,
          life.signal == 0 ? std::string("nothing") : fmt::format("signal {}", life.signal), end,
          life.told);
    } else if (life.told.find("were open after --drain-seconds") != std::string::npos) {
      Say("life", "the server of {:.3f} s cut off calls while it drained", start);
    }
  }

  void CheckFolder(const Folder& folder) {
    std::vector<std::pair<std::string, std::uint64_t>> here;
    for (const std::string& file : folder.files) {
      const std::size_t at = file.rfind('@'), dot = file.find(".tlmap");
      std::uint64_t version = 0;
      if (at == file.npos || dot == file.npos || dot < at ||
          std::from_chars(&file[at + 1], &file[dot], version).ptr != &file[dot]) {
        Say("folder", "'{}' is no map", file);
        continue;
      }
      const std::string name = file.substr(0, at), rest = file.substr(dot + 6);
      if (rest.starts_with(".damaged")) {
        CheckDamaged(file, name, version);
      } else if (!rest.empty()) {
        Say("folder", "'{}' was left behind", file);
      } else {
        here.emplace_back(name, version);
      }
    }
    for (const auto& [name, version] : here) {
      const auto known = maps_.At(name, version);
      // The file of a map that has expired goes a moment later.
      constexpr Time kMoment = 2'000'000;
      const auto may_be_there = [&](const KnownMap* map) {
        return map->GoneBy() + (map->expires != 0 ? kMoment : 0) > folder.at;
      };
      if (std::ranges::none_of(known, may_be_there)) {
        Say("folder", "{}@{} has a file and should not be there", name, version);
      }
    }
    for (const KnownMap& map : maps_.all()) {
      if (map.CertainlyThere(folder.at, folder.at) &&
          std::ranges::find(here, std::pair{map.name, map.version}) == here.end()) {
        Say("folder", "{} has no file", Story(map));
      }
    }
  }

  void CheckDamaged(const std::string& file, const std::string& name, std::uint64_t version) {
    const bool by_us = std::ranges::any_of(history_.damages, [&](const Damage& damage) {
      return damage.name == name && damage.version == version;
    });
    if (!by_us) Say("folder", "'{}' was set aside and was sound", file);
  }

  const History& history_;
  const KnownMaps maps_;
  std::vector<Violation> violations_;
};

}  // namespace

std::vector<Violation> Check(const History& history) { return Judge(history).Run(); }

}  // namespace treelight::faults
