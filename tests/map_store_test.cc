#include "server/map_store.h"

#include "gtest/gtest.h"
#include "tests/gated_builder.h"

namespace treelight::server {
namespace {

using std::chrono_literals::operator""ms;

StoredMap MakeMap(const std::string& name, const std::string& request_id = {},
                  std::optional<TimePoint> expires = {}) {
  const Photons photons{.positions = {0, 0, 0}, .powers = {}, .directions = {}};
  return {.name = name,
          .version = 0,
          .request_id = request_id,
          .options = {},
          .gatherer = *MakeBruteForceBuilder()->Build(photons, {}),
          .created = {},
          .expires = expires,
          .memory = {}};
}

TEST(MapStoreTest, VersionsGrowByNameAndVersionZeroIsTheNewest) {
  MapStore store;
  EXPECT_EQ(store.Add(MakeMap("a"))->version, 1u);
  EXPECT_EQ(store.Add(MakeMap("a"))->version, 2u);
  EXPECT_EQ(store.Add(MakeMap("b"))->version, 1u);
  EXPECT_EQ((*store.Find("a", 0))->version, 2u);
  EXPECT_EQ((*store.Find("a", 1))->version, 1u);
  EXPECT_EQ(store.List().size(), 3u);
}

TEST(MapStoreTest, NoVersionIsUsedTwice) {
  MapStore store;
  store.Add(MakeMap("a"));
  ASSERT_TRUE(store.Remove("a", 0).ok());
  EXPECT_EQ(store.Add(MakeMap("a"))->version, 2u);
}

TEST(MapStoreTest, NamesWithoutMapsAreForgottenAndNoVersionIsUsedTwiceStill) {
  MapStore store(std::chrono::system_clock::now, /*dead_names=*/10);
  store.Add(MakeMap("kept"));
  std::map<std::string, std::uint64_t> last;
  for (int round = 0; round < 3; ++round) {
    for (int i = 0; i < 100; ++i) {
      const std::string name = "name" + std::to_string(i);
      const std::uint64_t version = store.Add(MakeMap(name))->version;
      EXPECT_GT(version, last[name]) << name;
      last[name] = version;
      ASSERT_TRUE(store.Remove(name, 0).ok());
      EXPECT_LE(store.remembered_names(), 12u);  // "kept", ten without a map, the one just deleted
    }
  }
  EXPECT_EQ(store.Add(MakeMap("kept"))->version, 2u);  // its own count goes on
}

TEST(MapStoreTest, NotFoundNamesTheMapAndTheVersionsThereAre) {
  MapStore store;
  EXPECT_EQ(store.Find("a", 0).status().ToString(), "NOT_FOUND: no map is named 'a'");
  store.Add(MakeMap("a"));
  store.Add(MakeMap("a"));
  EXPECT_EQ(store.Find("a", 7).status().ToString(),
            "NOT_FOUND: map 'a' has no version 7, only 1, 2");
  EXPECT_EQ(store.Remove("a", 7).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store.List().size(), 2u);
}

TEST(MapStoreTest, NotFoundNamesTheNewestVersionsOfMany) {
  MapStore store;
  for (int i = 0; i < 2600; ++i) store.Add(MakeMap("a"));
  EXPECT_EQ(store.Find("a", 2601).status().ToString(),
            "NOT_FOUND: map 'a' has no version 2601, only 2593, 2594, 2595, 2596, 2597, 2598, "
            "2599, 2600 and 2592 older ones");
}

TEST(MapStoreTest, RemoveTakesOneVersionOrAllAndHandlesLiveOn) {
  MapStore store;
  const MapHandle first = store.Add(MakeMap("a"));
  store.Add(MakeMap("a"));
  store.Add(MakeMap("a"));
  EXPECT_EQ(store.Remove("a", 1)->size(), 1u);
  EXPECT_EQ(first->gatherer->photon_count(), 1u);
  EXPECT_EQ(store.Remove("a", 0)->size(), 2u);
  EXPECT_TRUE(store.List().empty());
}

TEST(MapStoreTest, ARepeatedRequestIdGivesTheFirstMap) {
  MapStore store;
  const MapHandle first = store.Add(MakeMap("a", "id"));
  EXPECT_EQ(store.FindRequest("id"), first);
  EXPECT_EQ(store.Add(MakeMap("other", "id")), first);
  EXPECT_EQ(store.List().size(), 1u);
  EXPECT_EQ(store.FindRequest(""), nullptr);
  ASSERT_TRUE(store.Remove("a", 1).ok());
  EXPECT_EQ(store.FindRequest("id"), nullptr);
}

TEST(MapStoreTest, ExpiredMapsAreInvisibleBeforeTheyAreSwept) {
  std::atomic<TimePoint> now = TimePoint(0ms);
  MapStore store([&] { return now.load(); });
  store.Add(MakeMap("a"));
  store.Add(MakeMap("a", "id", TimePoint(std::chrono::hours(5))));
  EXPECT_EQ((*store.Find("a", 0))->version, 2u);
  now = TimePoint(std::chrono::hours(5));
  EXPECT_EQ((*store.Find("a", 0))->version, 1u);
  EXPECT_EQ(store.Find("a", 2).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(store.FindRequest("id"), nullptr);
  EXPECT_EQ(store.List().size(), 1u);
  EXPECT_LE(store.SweepExpired(), 1u);  // none where the store's own sweeper came first
  EXPECT_EQ(store.SweepExpired(), 0u);
  EXPECT_EQ(store.List().size(), 1u);
}

TEST(MapStoreTest, ItsSizeFollowsWhatComesGoesAndExpires) {
  using std::chrono_literals::operator""h;
  std::atomic<TimePoint> now = TimePoint(0ms);
  MapStore store([&] { return now.load(); });
  store.Add(MakeMap("a"));
  const MapHandle dropped = store.Add(MakeMap("b", "b", TimePoint(3h)));
  for (const auto time : {5h, 2h, 4h, 3h}) store.Add(MakeMap("a", {}, TimePoint(time)));
  EXPECT_EQ(store.size(), 6u);
  ASSERT_TRUE(store.Remove("a", 4).ok());  // of 4 h
  EXPECT_EQ(store.size(), 5u);
  store.Drop({dropped});
  store.Drop({dropped});
  EXPECT_EQ(store.size(), 4u);
  store.Restore({dropped, dropped});
  EXPECT_EQ(store.size(), 5u);
  EXPECT_EQ(store.FindRequest("b"), dropped);
  const auto swept = [&] {  // by this call, or by the store's own thread
    store.SweepExpired();
    return store.size();
  };
  now = TimePoint(2h);
  EXPECT_EQ(swept(), 4u);
  now = TimePoint(3h);
  EXPECT_EQ(swept(), 2u);
  EXPECT_EQ(store.FindRequest("b"), nullptr);
  now = TimePoint(5h);
  EXPECT_EQ(swept(), 1u);
  EXPECT_EQ((*store.Find("a", 0))->version, 1u);
}

TEST(MapStoreTest, TheSweeperFreesExpiredMaps) {
  MapStore store;
  const std::weak_ptr<const StoredMap> map =
      store.Add(MakeMap("a", "id", std::chrono::system_clock::now() + 20ms));
  EXPECT_TRUE(treelight::testing::Eventually([&] { return map.expired(); }));
}

}  // namespace
}  // namespace treelight::server
