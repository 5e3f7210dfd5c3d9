#ifndef TREELIGHT_TESTS_REPLICAS_FIXTURE_H_
#define TREELIGHT_TESTS_REPLICAS_FIXTURE_H_

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "tests/server_fixture.h"
#include "tests/temporary_folder.h"

namespace treelight::testing {

/// Several servers in process on one data folder.
class ReplicatedTest : public ServerTest {
 protected:
  ReplicatedTest() { options_.data_folder = folder_ + "/maps"; }
  ~ReplicatedTest() override { replicas_.clear(); }

  /// Another server on the folder, the last of replicas_.
  v1::PhotonMapService::Stub& Replica(std::unique_ptr<Builder> builder = MakeBruteForceBuilder()) {
    auto server = server::Server::Start(options_, std::move(builder));
    EXPECT_TRUE(server.ok()) << server.status();
    auto stub = v1::PhotonMapService::NewStub((*server)->InProcessChannel());
    return *replicas_.emplace_back(*std::move(server), std::move(stub)).second;
  }

  static v1::PhotonMap BuildAt(v1::PhotonMapService::Stub& stub, const std::string& name,
                               const Photons& photons, const std::string& request_id = {},
                               std::uint64_t ttl_ms = 0) {
    auto messages = MakeUpload(name, photons);
    messages[0].mutable_header()->set_request_id(request_id);
    messages[0].mutable_header()->set_time_to_live_ms(ttl_ms);
    v1::BuildPhotonMapResponse response;
    const auto status = Build(stub, messages, response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response.map();
  }
  static grpc::Status GatherAt(v1::PhotonMapService::Stub& stub, const std::string& name,
                               v1::GatherResponse& response, std::uint64_t version = 0) {
    grpc::ClientContext context;
    auto batch = MakeBatch(name, kPosition, {.k = 5, .outputs = kOutputNeighbors});
    batch.set_version(version);
    return stub.Gather(&context, batch, &response);
  }
  /// Gathers in `name` and compares with brute force over `photons`; the version that answered.
  static std::uint64_t CheckAnswer(v1::PhotonMapService::Stub& stub, const std::string& name,
                                   const Photons& photons) {
    v1::GatherResponse response;
    const auto status = GatherAt(stub, name, response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    const auto expected = Expected(photons, kPosition, {.k = 5, .outputs = kOutputNeighbors});
    EXPECT_EQ(Array<std::uint32_t>(response.neighbor_ids()), expected.neighbor_ids);
    return response.version();
  }
  static grpc::StatusCode DeleteAt(v1::PhotonMapService::Stub& stub, const std::string& name,
                                   std::uint64_t version = 0) {
    grpc::ClientContext context;
    v1::DeletePhotonMapRequest request;
    request.set_name(name);
    request.set_version(version);
    v1::DeletePhotonMapResponse response;
    return stub.DeletePhotonMap(&context, request, &response).error_code();
  }
  /// name@version of all maps, and how many of them GetServerInfo tells.
  static std::vector<std::string> ListAt(v1::PhotonMapService::Stub& stub) {
    grpc::ClientContext context, info_context;
    v1::ListPhotonMapsResponse response;
    EXPECT_TRUE(stub.ListPhotonMaps(&context, {}, &response).ok());
    std::vector<std::string> names;
    for (const auto& map : response.maps()) {
      names.push_back(map.name() + "@" + std::to_string(map.version()));
    }
    v1::ServerInfo info;
    EXPECT_TRUE(stub.GetServerInfo(&info_context, {}, &info).ok());
    EXPECT_EQ(info.map_count(), names.size());
    return names;
  }

  static inline const std::vector<float> kPosition = {0.5f, 0.5f, 0.5f};
  TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();
  std::vector<
      std::pair<std::unique_ptr<server::Server>, std::unique_ptr<v1::PhotonMapService::Stub>>>
      replicas_;
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_REPLICAS_FIXTURE_H_
