#ifndef TREELIGHT_TESTS_FAULTS_STORY_H_
#define TREELIGHT_TESTS_FAULTS_STORY_H_

#include <algorithm>
#include <cstdint>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/faults/checker.h"
#include "tests/faults/history.h"
#include "tests/faults/model.h"

namespace treelight::faults {

/// A history that grows call by call, a second apart.
class Story {
 public:
  Story() { history_.lives.push_back({.start = 0, .ready = 1}); }

  Time now() const { return now_; }
  History& history() { return history_; }

  BuildTry& Build(const std::string& id, PhotonSet photons, Outcome outcome,
                  std::uint64_t version = 0) {
    BuildTry build{.request_id = id, .name = "map", .photons = photons};
    std::tie(build.start, build.end) = Span();
    build.outcome = outcome;
    if (outcome == Outcome::kOk) {
      build.answered_name = "map";
      build.version = version;
      build.photon_count = photons.count;
    }
    history_.builds.push_back(build);
    return history_.builds.back();
  }
  void Delete(std::uint64_t version, Outcome outcome) {
    faults::Delete gone{.name = "map", .version = version};
    std::tie(gone.start, gone.end) = Span();
    gone.outcome = outcome;
    history_.deletes.push_back(gone);
  }
  /// A gather of `asked` that `photons` as version `answered` answer.
  Gather& Gathers(std::uint64_t asked, PhotonSet photons, std::uint64_t answered) {
    Gather& gather = GathersNothing(asked, Outcome::kOk);
    gather.answered_name = "map";
    gather.answered_version = answered;
    const auto positions = MakeQueries(gather.queries);
    gather.result =
        *MakeBruteForce(photons)->Gather({.positions = positions}, MakeOptions(gather.queries));
    return gather;
  }
  Gather& GathersNothing(std::uint64_t asked, Outcome outcome) {
    Gather gather{.name = "map", .version = asked};
    gather.queries = {.count = 4, .seed = 7, .k = 5, .radius = 0.5f};
    std::tie(gather.start, gather.end) = Span();
    gather.outcome = outcome;
    history_.gathers.push_back(gather);
    return history_.gathers.back();
  }
  void Lists(std::vector<std::pair<std::uint64_t, std::uint64_t>> versions_and_counts) {
    List list;
    std::tie(list.start, list.end) = Span();
    list.outcome = Outcome::kOk;
    for (const auto& [version, count] : versions_and_counts) {
      list.maps.push_back({"map", version, count});
    }
    history_.lists.push_back(list);
  }
  void Damages(std::uint64_t version) {
    Damage damage{.name = "map", .version = version};
    std::tie(damage.start, damage.end) = Span();
    history_.damages.push_back(damage);
  }
  void KillsAndStarts() {
    Life& life = history_.lives.back();
    std::tie(life.end_asked, life.end) = Span();
    life.signal = life.ended_by = 9;
    const auto [start, ready] = Span();
    history_.lives.push_back({.start = start, .ready = ready});
  }

  /// The rules that were broken, each once.
  std::vector<std::string> Broken() const {
    std::vector<std::string> rules;
    for (const Violation& violation : Check(history_)) {
      if (std::ranges::find(rules, violation.rule) == rules.end()) rules.push_back(violation.rule);
    }
    return rules;
  }

 private:
  std::pair<Time, Time> Span() {
    now_ += 1'000'000;
    return {now_ - 900'000, now_};
  }

  Time now_ = 10;
  History history_;
};

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_STORY_H_
