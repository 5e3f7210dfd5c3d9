#include "tests/faults/known_maps.h"

#include <algorithm>
#include <functional>

#include "tests/faults/model.h"

namespace treelight::faults {

bool KnownMap::CertainlyThere(Time first, Time last) const {
  return known_by <= first &&
         std::ranges::none_of(removals, [last](const Removal& r) { return r.from <= last; });
}

Time KnownMap::GoneBy() const {
  Time gone = kNever;
  for (const Removal& removal : removals) gone = std::min(gone, removal.to);
  return gone;
}

KnownMaps::KnownMaps(const History& history) : history_(history) {
  CollectRequests();
  TakeAnsweredBuilds();
  TakeSights();
  TakeRemovals();
  Settle();
}

bool KnownMaps::Disturbed(Time first, Time last) const {
  const auto overlaps = [&](Time from, Time to) { return from <= last && first <= to; };
  for (std::size_t i = 0; i < history_.lives.size(); ++i) {
    const Life& life = history_.lives[i];
    if (life.end == 0) continue;
    const Time next = i + 1 < history_.lives.size() ? history_.lives[i + 1].ready : kNever;
    const Time asked = life.end_asked == 0 ? life.end : life.end_asked;
    if (overlaps(asked, next == 0 ? kNever : next)) return true;
  }
  return std::ranges::any_of(history_.cuts,
                             [&](const auto& cut) { return overlaps(cut.start, cut.end); });
}

/// When what a call might still do is over: with the process that it reached.
Time KnownMaps::EffectEnd(Time call_end) const {
  for (const Life& life : history_.lives) {
    if (life.end != 0 && life.end >= call_end) return life.end;
  }
  return kNever;
}

void KnownMaps::CollectRequests() {
  for (const BuildTry& build : history_.builds) {
    Request& request = requests_[build.request_id];
    request.name = build.name;
    request.photons = build.photons;
    request.time_to_live = build.time_to_live;
    request.tries.push_back(&build);
    // The client library repeats a build whose connection broke: what it tells may be of a repeat,
    // and the first may have built too.
    const bool unknown = build.outcome == Outcome::kUnknown || Disturbed(build.start, build.end);
    if (unknown && !build.must_be_refused) request.unknown.push_back(&build);
  }
  for (const auto& [id, request] : requests_) {
    if (!request.unknown.empty()) unknown_by_name_[request.name].push_back(&request);
  }
  // Few neighbours, or none, do not tell requests apart: the last one is the likely one.
  for (auto& [name, requests] : unknown_by_name_) {
    std::ranges::sort(requests, std::greater(),
                      [](const Request* request) { return request->unknown.front()->start; });
  }
}

KnownMap& KnownMaps::Add(const std::string& name, std::uint64_t version, const Request& request) {
  KnownMap& map = maps_.emplace_back();
  map.name = name;
  map.version = version;
  map.request = &request;
  map.born_from = map.known_by = kNever;
  auto& known = by_version_[{name, version}];
  known.insert(known.begin(), &map);  // the last one first
  by_name_[name].push_back(&map);
  return map;
}

void KnownMaps::TakeAnsweredBuilds() {
  std::vector<const BuildTry*> answered;
  for (const BuildTry& build : history_.builds) {
    if (build.outcome == Outcome::kOk) answered.push_back(&build);
  }
  std::ranges::sort(answered, {}, &BuildTry::end);
  for (const BuildTry* build : answered) {
    const Request& request = requests_.at(build->request_id);
    auto& known = by_version_[{build->answered_name, build->version}];
    const auto same = std::ranges::find_if(known, [&](const KnownMap* map) {
      if (map->request != &request) return false;
      // One that was deleted, or has expired, before this try began is another map.
      return std::abs(map->expires - build->expires) <= kExpirySlack &&
             std::ranges::none_of(history_.deletes, [&](const Delete& gone) {
               return gone.outcome == Outcome::kOk && gone.name == map->name &&
                      (gone.version == 0 || gone.version == map->version) &&
                      gone.start >= map->known_by && gone.end <= build->start;
             });
    });
    KnownMap* map = nullptr;
    if (same != known.end()) {
      map = *same;
    } else {
      const Time last_seen =
          known.empty() || known.front()->request != &request ? 0 : known.front()->known_by;
      map = &Add(build->answered_name, build->version, request);
      map->born_from = build->start;
      for (const BuildTry* earlier : request.unknown) {
        if (earlier->start >= last_seen) {
          map->born_from = std::min(map->born_from, earlier->start);
        }
      }
      map->expires = build->expires;
    }
    map->known_by = std::min(map->known_by, build->end);
    map->born_from = std::min(map->born_from, build->start);
    map->seen.push_back(build->start);
    map->answered = true;
  }
}

const Gatherer& KnownMaps::BruteForce(const PhotonSet& photons) const {
  constexpr std::size_t kKept = 256;
  const auto known =
      std::ranges::find(brute_forces_, photons, [](const auto& entry) { return entry.first; });
  if (known != brute_forces_.end()) {
    brute_forces_.splice(brute_forces_.begin(), brute_forces_, known);
  } else {
    brute_forces_.emplace_front(photons, MakeBruteForce(photons));
    if (brute_forces_.size() > kKept) brute_forces_.pop_back();
  }
  return *brute_forces_.front().second;
}

bool KnownMaps::Explains(const Request& request, const Gather& gather) const {
  return IsAnswer(BruteForce(request.photons), gather.queries, gather.result);
}

/// A map that only its being there tells of.
KnownMap& KnownMaps::AddUnknown(const Request& request, std::uint64_t version, Time seen_by) {
  KnownMap& map = Add(request.name, version, request);
  for (const BuildTry* build : request.unknown) {
    map.born_from = std::min(map.born_from, build->start);
  }
  map.known_by = seen_by;
  return map;
}

KnownMap* KnownMaps::Match(const Gather& gather) {
  for (KnownMap* map : by_version_[{gather.answered_name, gather.answered_version}]) {
    if (map->born_from < gather.end && Explains(*map->request, gather)) return map;
  }
  for (const Request* request : unknown_by_name_[gather.answered_name]) {
    if (request->unknown.front()->start < gather.end && Explains(*request, gather)) {
      return &AddUnknown(*request, gather.answered_version, gather.end);
    }
  }
  return nullptr;
}

KnownMap* KnownMaps::Match(const List& list, const Listed& listed) {
  for (KnownMap* map : by_version_[{listed.name, listed.version}]) {
    if (map->born_from < list.end && map->request->photons.count == listed.photon_count) return map;
  }
  for (const Request* request : unknown_by_name_[listed.name]) {
    if (request->unknown.front()->start < list.end &&
        request->photons.count == listed.photon_count) {
      return &AddUnknown(*request, listed.version, list.end);
    }
  }
  return nullptr;
}

/// Lists first: they tell more of a map than an answer without neighbours.
void KnownMaps::TakeSights() {
  for (const List& list : history_.lists) {
    for (const Listed& listed : list.maps) {
      KnownMap* const map = Match(list, listed);
      listed_[&listed] = map;
      if (map == nullptr) continue;
      map->known_by = std::min(map->known_by, list.end);
      map->seen.push_back(list.start);
    }
  }
  std::vector<const Gather*> gathers;
  for (const Gather& gather : history_.gathers) {
    if (gather.outcome == Outcome::kOk) gathers.push_back(&gather);
  }
  std::ranges::sort(gathers, {}, &Gather::end);
  for (const Gather* gather : gathers) {
    KnownMap* const map = Match(*gather);
    answering_[gather] = map;
    if (map == nullptr) continue;
    map->known_by = std::min(map->known_by, gather->end);
    map->seen.push_back(gather->start);
  }
}

void KnownMaps::TakeRemovals() {
  for (const Delete& gone : history_.deletes) {
    if (gone.outcome != Outcome::kOk && gone.outcome != Outcome::kUnknown) continue;
    const bool done = gone.outcome == Outcome::kOk;
    const Time effect_end = done ? gone.end : EffectEnd(gone.end);
    for (KnownMap* map : by_name_[gone.name]) {
      if (gone.version != 0 && gone.version != map->version) continue;
      if (effect_end <= map->born_from) continue;
      const bool certain = done && map->known_by <= gone.start;
      map->removals.push_back(
          {gone.start, certain ? gone.end : kNever, certain ? kNever : effect_end});
    }
  }
  for (const Damage& damage : history_.damages) {
    for (KnownMap* map : by_version_[{damage.name, damage.version}]) {
      if (damage.end > map->born_from) map->removals.push_back({.from = damage.start});
    }
  }
  for (KnownMap& map : maps_) {
    if (map.expires != 0) {
      map.removals.push_back({map.expires - kExpirySlack, map.expires + kExpirySlack, kNever});
    } else if (map.request->time_to_live != 0) {
      map.removals.push_back({.from = map.born_from + map.request->time_to_live - kExpirySlack});
    }
  }
}

/// What may have taken a map away has not where the map is seen later, unless its client may have
/// built it anew in between.
void KnownMaps::Settle() {
  for (KnownMap& map : maps_) {
    std::ranges::sort(map.seen);
    std::erase_if(map.removals, [&](const Removal& removal) {
      const auto later = std::ranges::lower_bound(map.seen, removal.settled);
      if (removal.settled == kNever || later == map.seen.end()) return false;
      return std::ranges::none_of(map.request->tries, [&](const BuildTry* build) {
        return build->end >= removal.from && build->start <= *later;
      });
    });
  }
}

std::vector<const KnownMap*> KnownMaps::Named(const std::string& name) const {
  const auto found = by_name_.find(name);
  if (found == by_name_.end()) return {};
  return {found->second.begin(), found->second.end()};
}

std::vector<const KnownMap*> KnownMaps::At(const std::string& name, std::uint64_t version) const {
  const auto found = by_version_.find({name, version});
  if (found == by_version_.end()) return {};
  return {found->second.begin(), found->second.end()};
}

template <typename Fits>
bool KnownMaps::AnotherFits(const KnownMap& gone, Time start, Time end, Fits fits) const {
  for (const KnownMap* map : At(gone.name, gone.version)) {
    if (map->born_from < end && map->GoneBy() > start && fits(*map->request)) return true;
  }
  const auto unknown = unknown_by_name_.find(gone.name);
  return unknown != unknown_by_name_.end() &&
         std::ranges::any_of(unknown->second, [&](const Request* request) {
           return request != gone.request && request->unknown.front()->start < end &&
                  fits(*request);
         });
}

bool KnownMaps::MayBeAnother(const KnownMap& gone, const Gather& gather) const {
  return AnotherFits(gone, gather.start, gather.end,
                     [&](const Request& request) { return Explains(request, gather); });
}

bool KnownMaps::MayBeAnother(const KnownMap& gone, const List& list, const Listed& listed) const {
  return AnotherFits(gone, list.start, list.end, [&](const Request& request) {
    return request.photons.count == listed.photon_count;
  });
}

const KnownMap* KnownMaps::Answering(const Gather& gather) const { return answering_.at(&gather); }

const KnownMap* KnownMaps::Matching(const List& list, std::size_t index) const {
  return listed_.at(&list.maps[index]);
}

}  // namespace treelight::faults
