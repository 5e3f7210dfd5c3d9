#ifndef TREELIGHT_TESTS_FAULTS_KNOWN_MAPS_H_
#define TREELIGHT_TESTS_FAULTS_KNOWN_MAPS_H_

#include <cstdint>
#include <deque>
#include <list>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/faults/history.h"

// Which maps a history tells of, since when each was there for certain, and until when.
namespace treelight::faults {

/// What one request id asked for, and how often.
struct Request {
  std::string name;
  PhotonSet photons;
  Time time_to_live = 0;
  std::vector<const BuildTry*> tries;
  /// Of the tries, those that may have built without that anybody was told.
  std::vector<const BuildTry*> unknown;
};

/// Something that takes a map away, or may have.
struct Removal {
  Time from = 0;          ///< not before
  Time to = kNever;       ///< it has happened by then; kNever: perhaps not at all
  Time settled = kNever;  ///< a map that is seen later than this was not taken away
};

/// What one request made: name and version.
struct KnownMap {
  std::string name;
  std::uint64_t version = 0;
  const Request* request = nullptr;
  Time born_from = 0;      ///< it was not there before
  Time known_by = 0;       ///< from then on it was, until it was taken away
  Time expires = 0;        ///< 0: never, or not known
  bool answered = false;   ///< its client was told of it
  std::vector<Time> seen;  ///< it was there at these times or later
  std::vector<Removal> removals;

  /// Whether it was there throughout [first, last].
  bool CertainlyThere(Time first, Time last) const;
  /// When it was gone for certain.
  Time GoneBy() const;
};

/// The maps of a history, which must outlive them.
class KnownMaps {
 public:
  explicit KnownMaps(const History& history);

  const std::deque<KnownMap>& all() const { return maps_; }
  /// All versions of a name, all maps that had one version of it.
  std::vector<const KnownMap*> Named(const std::string& name) const;
  std::vector<const KnownMap*> At(const std::string& name, std::uint64_t version) const;
  /// The map that gave the answer; null where none that could be there has these photons.
  const KnownMap* Answering(const Gather& gather) const;
  /// The map that the entry `index` of the list is; null as above.
  const KnownMap* Matching(const List& list, std::size_t index) const;

  /// Whether the sight of `gone`, by an answer or an entry of a list, may be that of another map,
  /// to which a later life of the server gave the same name and version: one that is known, or one
  /// whose build nobody was told of.
  bool MayBeAnother(const KnownMap& gone, const Gather& gather) const;
  bool MayBeAnother(const KnownMap& gone, const List& list, const Listed& listed) const;

  /// Whether brute force over the photons of `request` gives the answer of `gather`.
  bool Explains(const Request& request, const Gather& gather) const;

  const std::map<std::string, Request>& requests() const { return requests_; }

  /// Whether a connection was cut or a server ended in [first, last].
  bool Disturbed(Time first, Time last) const;

 private:
  void CollectRequests();
  void TakeAnsweredBuilds();
  void TakeSights();
  void TakeRemovals();
  void Settle();
  KnownMap& Add(const std::string& name, std::uint64_t version, const Request& request);
  template <typename Fits>
  bool AnotherFits(const KnownMap& gone, Time start, Time end, Fits fits) const;
  KnownMap* Match(const Gather& gather);
  KnownMap* Match(const List& list, const Listed& listed);
  KnownMap& AddUnknown(const Request& request, std::uint64_t version, Time seen_by);
  Time EffectEnd(Time call_end) const;
  const Gatherer& BruteForce(const PhotonSet& photons) const;

  const History& history_;
  std::map<std::string, Request> requests_;
  std::map<std::string, std::vector<const Request*>> unknown_by_name_;
  std::deque<KnownMap> maps_;
  std::map<std::pair<std::string, std::uint64_t>, std::vector<KnownMap*>> by_version_;
  std::map<std::string, std::vector<KnownMap*>> by_name_;
  std::map<const Gather*, const KnownMap*> answering_;
  std::map<const Listed*, const KnownMap*> listed_;
  // Photons that were asked for lately, the last first.
  mutable std::list<std::pair<PhotonSet, std::unique_ptr<const Gatherer>>> brute_forces_;
};

/// How exact the times of expiry are: two clocks, rounded to milliseconds.
inline constexpr Time kExpirySlack = 50'000;

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_KNOWN_MAPS_H_
