#include <filesystem>
#include <functional>
#include <future>
#include <span>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "tests/gated_service.h"
#include "tests/replicas_fixture.h"
#include "tests/waiting_requests.h"

// A request id stands for one request: repeated it answers with the map of the first, and with any
// other request it is refused.
namespace treelight::testing {
namespace {

using ::testing::HasSubstr;

constexpr char kAdvice[] = "; repeat that one unchanged, or give this one an id of its own";

using Upload = std::vector<v1::BuildPhotonMapRequest>;

Upload MakeUploadWithId(const std::string& name, const Photons& photons, const std::string& id) {
  auto messages = MakeUpload(name, photons);
  messages[0].mutable_header()->set_request_id(id);
  return messages;
}

v1::RebuildPhotonMapRequest MakeRebuild(const std::string& id) {
  v1::RebuildPhotonMapRequest request;
  request.set_name("cloud");
  request.set_request_id(id);
  return request;
}

/// "" for OK, else code and message.
std::string Told(const grpc::Status& status) {
  if (status.ok()) return {};
  return std::to_string(status.error_code()) + " " + status.error_message();
}

class ServiceRequestIdTest : public GatedServiceTest {
 protected:
  std::string BuildAgain(const Upload& messages) {
    return Told(Build(*stub_, messages, response_));
  }
  std::string RebuildAgain(const v1::RebuildPhotonMapRequest& request) {
    grpc::ClientContext context;
    return Told(stub_->RebuildPhotonMap(&context, request, &response_));
  }

  v1::BuildPhotonMapResponse response_;  // of the last call that was answered
};

TEST_F(ServiceRequestIdTest, ARepeatIsAnsweredWithTheFirstMap) {
  StartGated();
  auto messages = MakeUploadWithId("once", photons_, "try-1");
  messages[0].mutable_header()->mutable_options()->set_builder(v1::BUILDER_KIND_HYBRID);
  messages[0].mutable_header()->set_time_to_live_ms(1'000'000);
  ASSERT_EQ(BuildAgain(messages), "");
  const std::string first = response_.map().SerializeAsString();
  ASSERT_EQ(BuildAgain(messages), "");
  EXPECT_EQ(response_.map().SerializeAsString(), first);
  EXPECT_EQ(MustBuild("once", photons_).version(), 2u);  // without an id
}

TEST_F(ServiceRequestIdTest, AnotherRequestIsRefusedAndTheFieldIsNamed) {
  StartGated();
  auto messages = MakeUploadWithId("once", photons_, "try-1");
  messages[0].mutable_header()->mutable_options()->set_rounds(2);
  ASSERT_EQ(BuildAgain(messages), "");
  const int builds = gate_->builds;
  const auto refused = [&](const std::function<void(v1::BuildHeader&)>& change) {
    auto changed = messages;
    change(*changed[0].mutable_header());
    return BuildAgain(changed);
  };
  const std::string begin =
      "3 header.request_id is 'try-1', by which map 'once@1' was built from another request: ";
  EXPECT_EQ(refused([](auto& header) { header.set_name("other"); }),
            begin + "header.name was \"once\", now \"other\"" + kAdvice);
  EXPECT_EQ(refused([](auto& header) { header.set_photon_count(999); }),
            begin + "header.photon_count was 1000, now 999" + kAdvice);
  EXPECT_EQ(refused([](auto& header) { header.set_has_powers(false); }),
            begin + "header.has_powers was true, now false" + kAdvice);
  EXPECT_EQ(refused([](auto& header) { header.set_has_directions(false); }),
            begin + "header.has_directions was true, now false" + kAdvice);
  EXPECT_EQ(refused([](auto& header) { header.mutable_options()->set_rounds(3); }),
            begin + "header.options.rounds was 2, now 3" + kAdvice);
  EXPECT_EQ(refused([](auto& header) { header.clear_options(); }),
            begin + "header.options.rounds was 2, now 0" + kAdvice);
  EXPECT_EQ(refused([](auto& header) {
              header.mutable_options()->set_builder(v1::BUILDER_KIND_TREELET);
            }),
            begin +
                "header.options.builder was BUILDER_KIND_UNSPECIFIED, now "
                "BUILDER_KIND_TREELET" +
                kAdvice);
  // Not the same: absent stands for 50.
  EXPECT_EQ(refused([](auto& header) { header.mutable_options()->set_expected_k(0); }),
            begin + "header.options.expected_k was absent, now 0" + kAdvice);
  EXPECT_EQ(refused([](auto& header) { header.set_time_to_live_ms(5); }),
            begin + "header.time_to_live_ms was 0, now 5" + kAdvice);
  EXPECT_EQ(gate_->builds, builds);
  EXPECT_EQ(BuildAgain(messages), "");
  Delete("once");
  // The id is free again.
  EXPECT_EQ(refused([](auto& header) { header.set_name("other"); }), "");
}

TEST_F(ServiceRequestIdTest, FieldsThatTheServerDoesNotKnowAreNotKept) {
  StartGated();
  auto messages = MakeUploadWithId("once", photons_, "try-1");
  v1::BuildHeader& header = *messages[0].mutable_header();
  header.GetReflection()->MutableUnknownFields(&header)->AddLengthDelimited(
      999, std::string(1'000'000, 'x'));
  ASSERT_EQ(BuildAgain(messages), "");
  EXPECT_EQ(BuildAgain(MakeUploadWithId("once", photons_, "try-1")), "");
  EXPECT_EQ(response_.map().version(), 1u);
}

TEST_F(ServiceRequestIdTest, TwoAtOnceMakeOneMap) {
  options_.metrics_listen = "127.0.0.1:0";
  StartGated();
  gate_->open = false;
  const auto messages = MakeUploadWithId("once", photons_, "try-1");
  v1::BuildPhotonMapResponse responses[2];
  std::vector<std::future<grpc::Status>> calls;
  for (auto& response : responses) {
    calls.push_back(
        std::async(std::launch::async, [&] { return Build(*stub_, messages, response); }));
  }
  ASSERT_TRUE(Eventually([&] { return gate_->builds == 2 && WaitingRequests(*server_) == 1; }));
  gate_->open = true;
  for (auto& call : calls) EXPECT_TRUE(call.get().ok());
  EXPECT_EQ(responses[0].map().SerializeAsString(), responses[1].map().SerializeAsString());
  EXPECT_EQ(gate_->builds, 2);
}

TEST_F(ServiceRequestIdTest, OfTwoAtOnceThatDifferOneIsRefused) {
  options_.metrics_listen = "127.0.0.1:0";
  StartGated();
  gate_->open = false;
  auto first = std::async(std::launch::async, [&] {
    v1::BuildPhotonMapResponse response;
    return Build(*stub_, MakeUploadWithId("once", photons_, "try-1"), response);
  });
  ASSERT_TRUE(Eventually([&] { return gate_->builds == 2; }));
  auto second = std::async(std::launch::async, [&] {
    v1::BuildPhotonMapResponse response;
    return Build(*stub_, MakeUploadWithId("other", photons_, "try-1"), response);
  });
  ASSERT_TRUE(Eventually([&] { return WaitingRequests(*server_) == 1; }));
  gate_->open = true;
  EXPECT_TRUE(first.get().ok());
  EXPECT_THAT(Told(second.get()), HasSubstr("header.name was \"once\", now \"other\""));
  EXPECT_EQ(gate_->builds, 2);
}

TEST_F(ServiceRequestIdTest, ARepeatedRebuildIsAnsweredAlsoWhenItsSourceHasGone) {
  StartGated();
  auto request = MakeRebuild("again");
  request.set_new_name("copy");
  ASSERT_EQ(RebuildAgain(request), "");
  Delete("cloud");
  EXPECT_EQ(RebuildAgain(request), "");
  EXPECT_EQ(response_.map().name(), "copy");
  EXPECT_EQ(response_.map().version(), 1u);
  EXPECT_EQ(gate_->builds, 2);
  EXPECT_EQ(LogOf("RebuildPhotonMap")["request_id"], "again");
}

TEST_F(ServiceRequestIdTest, AnotherRebuildAndABuildAreRefused) {
  StartGated();
  ASSERT_EQ(RebuildAgain(MakeRebuild("again")), "");
  auto request = MakeRebuild("again");
  request.set_version(1);  // not the newest
  const std::string of_map =
      "request_id is 'again', by which map 'cloud@2' was built from another "
      "request: ";
  EXPECT_EQ(RebuildAgain(request), "3 " + of_map + "version was 0, now 1" + kAdvice);
  EXPECT_EQ(BuildAgain(MakeUploadWithId("cloud", photons_, "again")),
            "3 header." + of_map + "it was of another kind of call" + kAdvice);
  EXPECT_EQ(RebuildAgain(MakeRebuild("again")), "");
  EXPECT_EQ(response_.map().version(), 2u);
  EXPECT_EQ(gate_->builds, 2);
}

class KeptRequestIdTest : public ReplicatedTest {
 protected:
  void End() { stub_.reset(), server_.reset(); }
  static std::string Again(v1::PhotonMapService::Stub& stub, const Upload& messages,
                           v1::PhotonMap* map = nullptr) {
    v1::BuildPhotonMapResponse response;
    const auto status = Build(stub, messages, response);
    if (map != nullptr) *map = response.map();
    return Told(status);
  }
};

TEST_F(KeptRequestIdTest, ItStandsForTheSameInTheNextLife) {
  Start(MakeCpuBuilder());
  auto messages = MakeUploadWithId("cloud", MakePhotons(10, 1), "one");
  messages[0].mutable_header()->mutable_options()->set_builder(v1::BUILDER_KIND_AUTO);
  v1::PhotonMap built, repeated;
  ASSERT_EQ(Again(*stub_, messages, &built), "");
  auto rebuild = MakeRebuild("two");
  v1::BuildPhotonMapResponse response;
  grpc::ClientContext first, second, third;
  ASSERT_TRUE(stub_->RebuildPhotonMap(&first, rebuild, &response).ok());
  End();
  Start(MakeCpuBuilder());
  ASSERT_EQ(Again(*stub_, messages, &repeated), "");
  EXPECT_EQ(repeated.version(), 1u);
  EXPECT_EQ(repeated.created_unix_ms(), built.created_unix_ms());
  ASSERT_TRUE(stub_->RebuildPhotonMap(&second, rebuild, &response).ok());
  EXPECT_EQ(response.map().version(), 2u);
  EXPECT_EQ(ListAt(*stub_).size(), 2u);

  auto other = messages;
  other[0].mutable_header()->mutable_options()->set_builder(v1::BUILDER_KIND_LBVH);
  EXPECT_THAT(Again(*stub_, other),
              HasSubstr("options.builder was BUILDER_KIND_AUTO, now BUILDER_KIND_LBVH"));
  rebuild.set_time_to_live_ms(7);
  EXPECT_THAT(Told(stub_->RebuildPhotonMap(&third, rebuild, &response)),
              HasSubstr("time_to_live_ms was 0, now 7"));
  EXPECT_EQ(Again(*stub_, MakeUploadWithId("cloud", MakePhotons(10, 1), "three"), &built), "");
  EXPECT_EQ(built.version(), 3u);
}

TEST_F(KeptRequestIdTest, OfAFileOfFormat1WhatItTellsIsCompared) {
  std::filesystem::create_directory(options_.data_folder);
  std::filesystem::copy_file(std::string(TREELIGHT_SNAPSHOTS) + "/format_1.tlmap",
                             options_.data_folder + "/room.1@7.tlmap");
  Start();
  auto messages = MakeUploadWithId("room.1", MakePhotons(100, 1), "request-1");
  v1::PhotonMap map;
  EXPECT_EQ(Again(*stub_, messages, &map), "");
  EXPECT_EQ(map.version(), 7u);
  messages[0].mutable_header()->mutable_options()->set_rounds(
      8);  // it does not tell what was asked
  EXPECT_EQ(Again(*stub_, messages, &map), "");
  EXPECT_EQ(map.version(), 7u);
  messages[0].mutable_header()->set_time_to_live_ms(5);
  EXPECT_THAT(Again(*stub_, messages), HasSubstr("header.time_to_live_ms was 0, now 5"));
  messages[0].mutable_header()->set_photon_count(101);
  EXPECT_THAT(Again(*stub_, messages), HasSubstr("header.photon_count was 100, now 101"));
  auto rebuild = MakeRebuild("request-1");
  v1::BuildPhotonMapResponse response;
  grpc::ClientContext first, second;
  EXPECT_THAT(Told(stub_->RebuildPhotonMap(&first, rebuild, &response)),
              HasSubstr("new_name was \"room.1\", now \"\""));
  rebuild.set_new_name("room.1");
  EXPECT_EQ(Told(stub_->RebuildPhotonMap(&second, rebuild, &response)), "");
  EXPECT_EQ(response.map().version(), 7u);
  EXPECT_EQ(ListAt(*stub_), (std::vector<std::string>{"room.1@7"}));
}

TEST_F(KeptRequestIdTest, ARepeatAtAnotherServerIsAnsweredWithTheFirstMap) {
  Start();
  auto& other = Replica();
  const auto built = BuildAt(*stub_, "cloud", MakePhotons(100, 1), "one");
  const auto repeated = BuildAt(other, "cloud", MakePhotons(100, 1), "one");
  EXPECT_EQ(repeated.version(), 1u);
  EXPECT_EQ(repeated.created_unix_ms(), built.created_unix_ms());
  EXPECT_EQ(ListAt(*stub_), (std::vector<std::string>{"cloud@1"}));

  auto request = MakeRebuild("two");
  request.set_new_name("again");
  v1::BuildPhotonMapResponse first, second;
  grpc::ClientContext here, there;
  ASSERT_TRUE(other.RebuildPhotonMap(&here, request, &first).ok());
  ASSERT_TRUE(stub_->RebuildPhotonMap(&there, request, &second).ok());
  EXPECT_EQ(second.map().created_unix_ms(), first.map().created_unix_ms());
  EXPECT_EQ(ListAt(*stub_), (std::vector<std::string>{"again@1", "cloud@1"}));
}

TEST_F(KeptRequestIdTest, AnotherRequestAtAnotherServerIsRefused) {
  Start();
  auto& other = Replica();
  BuildAt(*stub_, "cloud", MakePhotons(100, 1), "one");
  EXPECT_THAT(Again(other, MakeUploadWithId("rain", MakePhotons(100, 1), "one")),
              HasSubstr("header.name was \"cloud\", now \"rain\""));
  EXPECT_EQ(ListAt(other), (std::vector<std::string>{"cloud@1"}));
}

TEST_F(KeptRequestIdTest, BuildsOfOneRequestAtTheSameMomentMakeOneMap) {
  Start();
  std::vector<v1::PhotonMapService::Stub*> stubs = {stub_.get(), &Replica(), &Replica()};
  for (int round = 0; round < 10; ++round) {
    const std::string id = "id" + std::to_string(round);
    std::vector<std::future<v1::PhotonMap>> builds;
    for (auto* stub : stubs) {
      builds.push_back(std::async(std::launch::async, [stub, id] {
        return BuildAt(*stub, "cloud", MakePhotons(200, 1), id);
      }));
    }
    const v1::PhotonMap first = builds[0].get();
    for (auto& build : std::span(builds).subspan(1)) {
      const v1::PhotonMap map = build.get();
      EXPECT_EQ(map.version(), first.version());
      EXPECT_EQ(map.created_unix_ms(), first.created_unix_ms());
    }
  }
  for (auto* stub : stubs) EXPECT_EQ(ListAt(*stub).size(), 10u);
}

TEST_F(KeptRequestIdTest, OfRequestsThatDifferAtTheSameMomentOneMakesAMap) {
  Start();
  std::vector<v1::PhotonMapService::Stub*> stubs = {stub_.get(), &Replica(), &Replica()};
  for (std::size_t round = 0; round < 10; ++round) {
    const std::string id = "id" + std::to_string(round);
    std::vector<std::future<std::string>> builds;
    for (std::size_t i = 0; i < stubs.size(); ++i) {
      builds.push_back(std::async(std::launch::async, [stub = stubs[i], i, id] {
        return Again(*stub, MakeUploadWithId("cloud", MakePhotons(200 + i, 1), id));
      }));
    }
    int built = 0;
    for (auto& build : builds) {
      const std::string told = build.get();
      built += told.empty() ? 1 : 0;
      if (told.empty()) continue;
      EXPECT_THAT(told, HasSubstr("header.photon_count was 20"));
    }
    EXPECT_EQ(built, 1);
    for (auto* stub : stubs) EXPECT_EQ(ListAt(*stub).size(), round + 1);
  }
}

}  // namespace
}  // namespace treelight::testing
