#include "tests/faults/checker.h"

#include <string>
#include <utility>

#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/faults/model.h"
#include "tests/faults/story.h"

// Histories made by hand: one that keeps all promises, and for each rule some that break it alone.
namespace treelight::faults {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr PhotonSet kFirst{.count = 50, .seed = 1}, kSecond{.count = 60, .seed = 2};

TEST(CheckerTest, KeptPromisesAreNoViolations) {
  Story story;
  story.Build("a", kFirst, Outcome::kOk, 1);
  story.Gathers(0, kFirst, 1);
  story.Build("b", kSecond, Outcome::kOk, 2);
  story.Build("b", kSecond, Outcome::kOk, 2);  // the same request
  story.Gathers(0, kSecond, 2);
  story.Gathers(1, kFirst, 1);
  story.KillsAndStarts();
  story.Lists({{1, 50}, {2, 60}});
  story.Delete(1, Outcome::kOk);
  story.GathersNothing(1, Outcome::kNotFound);
  story.Lists({{2, 60}});
  story.history().quiets.push_back({.at = story.now(), .resident_bytes = 5});
  EXPECT_THAT(story.Broken(), IsEmpty());
}

TEST(CheckerTest, ABuildOfUnknownEndMayBeThereOrNot) {
  Story there;
  there.Build("a", kFirst, Outcome::kUnknown);
  there.Gathers(0, kFirst, 1);
  EXPECT_THAT(there.Broken(), IsEmpty());
  Story missing;
  missing.Build("a", kFirst, Outcome::kUnknown);
  missing.GathersNothing(0, Outcome::kNotFound);
  EXPECT_THAT(missing.Broken(), IsEmpty());
  there.GathersNothing(0, Outcome::kNotFound);  // it was there
  EXPECT_THAT(there.Broken(), ElementsAre("lost"));
}

TEST(CheckerTest, ADeleteOfUnknownEndMayStillHappenUntilItsServerEnds) {
  Story story;
  story.Build("a", kFirst, Outcome::kOk, 1);
  story.Delete(1, Outcome::kUnknown);
  story.Gathers(1, kFirst, 1);
  story.GathersNothing(1, Outcome::kNotFound);
  EXPECT_THAT(story.Broken(), IsEmpty());
  Story settled;
  settled.Build("a", kFirst, Outcome::kOk, 1);
  settled.Delete(1, Outcome::kUnknown);
  settled.KillsAndStarts();
  settled.Gathers(1, kFirst, 1);
  settled.GathersNothing(1, Outcome::kNotFound);
  EXPECT_THAT(settled.Broken(), ElementsAre("lost"));
}

TEST(CheckerTest, WhatWasAnsweredIsNotLost) {
  Story gather, list, deletion, damaged;
  for (Story* story : {&gather, &list, &deletion, &damaged}) {
    story->Build("a", kFirst, Outcome::kOk, 1);
    story->KillsAndStarts();
  }
  gather.GathersNothing(0, Outcome::kNotFound);
  EXPECT_THAT(gather.Broken(), ElementsAre("lost"));
  list.Lists({});
  EXPECT_THAT(list.Broken(), ElementsAre("lost"));
  deletion.Delete(1, Outcome::kNotFound);
  EXPECT_THAT(deletion.Broken(), ElementsAre("lost"));
  damaged.GathersNothing(1, Outcome::kDataLoss);
  EXPECT_THAT(damaged.Broken(), ElementsAre("lost"));
}

TEST(CheckerTest, ADamagedFileCostsItsOwnMapAlone) {
  Story story;
  story.Build("a", kFirst, Outcome::kOk, 1);
  story.Build("b", kSecond, Outcome::kOk, 2);
  story.Damages(2);
  story.KillsAndStarts();
  story.GathersNothing(2, Outcome::kDataLoss);
  story.Gathers(0, kFirst, 1);
  EXPECT_THAT(story.Broken(), IsEmpty());
  story.Lists({});
  EXPECT_THAT(story.Broken(), ElementsAre("lost"));
}

TEST(CheckerTest, WhatWasDeletedOrHasExpiredDoesNotComeBack) {
  Story deleted;
  deleted.Build("a", kFirst, Outcome::kOk, 1);
  deleted.Delete(0, Outcome::kOk);
  deleted.KillsAndStarts();
  deleted.Lists({{1, 50}});
  EXPECT_THAT(deleted.Broken(), ElementsAre("came back"));
  Story expired;
  BuildTry& build = expired.Build("a", kFirst, Outcome::kOk, 1);
  build.time_to_live = 200'000;
  build.expires = build.start + 200'000;
  expired.Gathers(1, kFirst, 1);
  EXPECT_THAT(expired.Broken(), ElementsAre("came back"));
}

TEST(CheckerTest, AVersionThatALaterLifeGaveAgainIsNotTheOneThatIsGone) {
  for (const bool built_again : {true, false}) {
    Story story;
    story.Build("a", kFirst, Outcome::kOk, 1);
    story.Delete(1, Outcome::kOk);
    story.KillsAndStarts();
    if (built_again) story.Build("b", kSecond, Outcome::kUnknown);
    // Neither has a photon so near: the answer is that of both.
    Gather& gather = story.Gathers(0, kFirst, 1);
    gather.queries = {.count = 1, .seed = 7, .k = 5, .radius = 1e-6f};
    gather.result = *MakeBruteForce(kSecond)->Gather({.positions = MakeQueries(gather.queries)},
                                                     MakeOptions(gather.queries));
    ASSERT_EQ(gather.result.counts, (std::vector<std::uint32_t>{0}));
    if (built_again) {
      EXPECT_THAT(story.Broken(), IsEmpty());
    } else {
      EXPECT_THAT(story.Broken(), ElementsAre("came back"));
    }
  }
}

TEST(CheckerTest, AnswersAreThoseOfBruteForceOverTheVersionTheyName) {
  Story wrong;
  wrong.Build("a", kFirst, Outcome::kOk, 1);
  wrong.Build("b", kSecond, Outcome::kOk, 2);
  Story tie = wrong, other = wrong, name = wrong;
  wrong.Gathers(1, kFirst, 1).result.neighbor_ids.back() ^= 1;
  EXPECT_THAT(wrong.Broken(), ElementsAre("answer"));
  tie.Gathers(1, kFirst, 1).result.radii.front() *= 1.0000001f;
  EXPECT_THAT(tie.Broken(), ElementsAre("answer"));
  other.Gathers(2, kFirst, 2);
  EXPECT_THAT(other.Broken(), ElementsAre("answer"));
  name.Gathers(2, kFirst, 1);
  EXPECT_THAT(name.Broken(), ElementsAre("answer"));
}

TEST(CheckerTest, TheNewestMayBeDeletedWhileItComesBack) {
  Story story;
  story.Build("a", kFirst, Outcome::kOk, 1);
  story.Build("b", kSecond, Outcome::kOk, 2);
  Gather& gather = story.GathersNothing(0, Outcome::kNotFound);
  gather.told = "NOT_FOUND: 'map@2.tlmap' of the data folder: it is gone";
  EXPECT_THAT(story.Broken(), ElementsAre("lost"));
  gather.end += 1'500'000;
  story.Delete(2, Outcome::kOk);
  EXPECT_THAT(story.Broken(), IsEmpty());
}

TEST(CheckerTest, TheNewestIsTheNewest) {
  Story story;
  story.Build("a", kFirst, Outcome::kOk, 1);
  story.Build("b", kSecond, Outcome::kOk, 2);
  story.Gathers(0, kFirst, 1);
  EXPECT_THAT(story.Broken(), ElementsAre("stale"));
}

TEST(CheckerTest, WhatIsRefusedLeavesNothing) {
  Story seen;
  seen.Build("a", kFirst, Outcome::kRefused);
  seen.Gathers(0, kFirst, 1);
  EXPECT_THAT(seen.Broken(), ElementsAre("refused"));
  Story listed;
  listed.Build("a", kFirst, Outcome::kRefused);
  listed.Lists({{1, 50}});
  EXPECT_THAT(listed.Broken(), ElementsAre("refused"));
  Story taken;
  taken.Build("a", kFirst, Outcome::kOk, 1).must_be_refused = true;
  EXPECT_THAT(taken.Broken(), ElementsAre("refused"));
  // A repeat inside the client library may have been refused after the first try built.
  Story cut;
  const BuildTry& build = cut.Build("a", kFirst, Outcome::kRefused);
  cut.history().cuts.push_back({build.start + 1, build.start + 2});
  cut.Lists({{1, 50}});
  EXPECT_THAT(cut.Broken(), IsEmpty());
}

TEST(CheckerTest, ARequestMakesOneMap) {
  Story story;
  story.Build("a", kFirst, Outcome::kOk, 1);
  Story again = story;
  story.Build("a", kFirst, Outcome::kOk, 2);
  EXPECT_THAT(story.Broken(), ElementsAre("request id"));
  again.Delete(1, Outcome::kOk);
  again.Build("a", kFirst, Outcome::kOk, 2);
  EXPECT_THAT(again.Broken(), IsEmpty());
  // The connection broke after the first had built, and what it built was deleted before the client
  // library asked again.
  Story cut;
  cut.Lists({});
  const Time start = cut.now();
  cut.Lists({{1, 50}});
  cut.Delete(0, Outcome::kOk);
  BuildTry& build = cut.Build("a", kFirst, Outcome::kOk, 2);
  build.start = start;
  EXPECT_THAT(cut.Broken(), ElementsAre("refused"));
  cut.history().cuts.push_back({start + 1, start + 2});
  EXPECT_THAT(cut.Broken(), IsEmpty());
  Story other;
  other.Build("a", kFirst, Outcome::kOk, 1).photon_count = 60;
  EXPECT_THAT(other.Broken(), ElementsAre("request id"));
}

TEST(CheckerTest, AnotherRequestWithATakenIdIsRefused) {
  Story story;
  story.Build("a", kFirst, Outcome::kOk, 1);
  Story refused = story, gone = story;
  story.Build("b", kSecond, Outcome::kOk, 2).sent_id = "a";
  EXPECT_THAT(story.Broken(), ElementsAre("request id"));
  refused.Build("b", kSecond, Outcome::kRefused).sent_id = "a";
  EXPECT_THAT(refused.Broken(), IsEmpty());
  gone.Delete(1, Outcome::kOk);
  gone.Build("b", kSecond, Outcome::kOk, 2).sent_id = "a";
  EXPECT_THAT(gone.Broken(), IsEmpty());
}

TEST(CheckerTest, NoVersionIsUsedTwiceInOneLifeAndLaterOnesAreLarger) {
  Story twice;
  twice.Build("a", kFirst, Outcome::kOk, 1);
  twice.Delete(1, Outcome::kOk);
  Story in_next_life = twice, there = twice;
  twice.Build("b", kSecond, Outcome::kOk, 1);
  EXPECT_THAT(twice.Broken(), ElementsAre("version"));
  in_next_life.KillsAndStarts();
  in_next_life.Build("b", kSecond, Outcome::kOk, 1);
  EXPECT_THAT(in_next_life.Broken(), IsEmpty());
  Story backwards;
  backwards.Build("a", kFirst, Outcome::kOk, 2);
  backwards.KillsAndStarts();
  backwards.Build("b", kSecond, Outcome::kOk, 1);
  EXPECT_THAT(backwards.Broken(), ElementsAre("version"));
}

TEST(CheckerTest, NothingIsHeldWhenNobodyAsks) {
  Story story;
  for (const Quiet& quiet :
       {Quiet{.open_calls = 1}, Quiet{.open_builds = 1}, Quiet{.held_bytes = 1},
        Quiet{.queue_depth = 1}, Quiet{.resident_bytes = 101}}) {
    story.history().resident_limit = 100;
    story.history().quiets = {quiet};
    EXPECT_THAT(story.Broken(), ElementsAre("held"));
  }
}

TEST(CheckerTest, ServersStartAndEndAsTheyAreTold) {
  for (const Life& life :
       {Life{.start = 1}, Life{.start = 1, .ready = 2, .end = 3, .ended_by = 6},
        Life{.start = 1, .ready = 2, .end_asked = 3, .end = 4, .signal = 15, .exit_code = 1},
        Life{.start = 1, .ready = 2, .end_asked = 3, .end = 4, .signal = 9, .ended_by = 11},
        Life{.start = 1,
        .ready = 2,
        .end_asked = 3,
        .end = 4,
        .signal = 15,
        .exit_code = 0,
        .told = "2 calls were open after --drain-seconds and were cancelled"}}) {
    Story story;
    story.history().lives = {life};
    EXPECT_THAT(story.Broken(), ElementsAre("life"));
  }
}

TEST(CheckerTest, TheFolderHoldsTheMapsThatAreThere) {
  Story story;
  story.Build("a", kFirst, Outcome::kOk, 1);
  story.Build("b", kSecond, Outcome::kOk, 2);
  story.Delete(1, Outcome::kOk);
  story.history().folders = {{.at = story.now() + 1, .files = {"map@2.tlmap"}}};
  Folder& folder = story.history().folders.front();
  EXPECT_THAT(story.Broken(), IsEmpty());
  for (const std::vector<std::string>& files : {std::vector<std::string>{},
                                                {"map@1.tlmap", "map@2.tlmap"},
                                                {"map@2.tlmap", "map@3.tlmap.abcdef.tmp"},
                                                {"map@2.tlmap", "map@1.tlmap.damaged"},
                                                {"core", "map@2.tlmap"}}) {
    folder.files = files;
    EXPECT_THAT(story.Broken(), ElementsAre("folder"));
  }
}

TEST(CheckerTest, NoCallFailsByTheServerAlone) {
  Story story;
  story.GathersNothing(0, Outcome::kRefused).told = "INTERNAL: something broke";
  EXPECT_THAT(story.Broken(), ElementsAre("trouble"));
  const Gather& gather = story.history().gathers.back();
  story.history().cuts.push_back({gather.start, gather.start});
  EXPECT_THAT(story.Broken(), IsEmpty());
}

}  // namespace
}  // namespace treelight::faults
