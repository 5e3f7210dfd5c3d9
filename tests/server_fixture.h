#ifndef TREELIGHT_TESTS_SERVER_FIXTURE_H_
#define TREELIGHT_TESTS_SERVER_FIXTURE_H_

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/builder.h"
#include "grpcpp/client_context.h"
#include "gtest/gtest.h"
#include "server/server.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::testing {

/// The `bytes` of an array.
template <typename T>
std::string Bytes(const std::vector<T>& array) {
  return {reinterpret_cast<const char*>(array.data()), array.size() * sizeof(T)};
}

/// The array in `bytes`.
template <typename T>
std::vector<T> Array(const std::string& bytes) {
  std::vector<T> array(bytes.size() / sizeof(T));
  std::copy_n(bytes.data(), array.size() * sizeof(T), reinterpret_cast<char*>(array.data()));
  return array;
}

/// `count` photons in the unit cube with powers and directions, the same for the same seed.
Photons MakePhotons(std::size_t count, std::uint32_t seed);

/// [3 * count] points in the unit cube.
std::vector<float> MakePoints(std::size_t count, std::uint32_t seed);

/// A CPU with as much memory as there can be.
DeviceInfo MakeCpu();

/// The messages of an upload of `photons`: a header, then chunks of `photons_per_chunk`.
std::vector<v1::BuildPhotonMapRequest> MakeUpload(const std::string& name, const Photons& photons,
                                                  std::size_t photons_per_chunk = 1000);

/// A batch for version 0 of map `name`.
v1::GatherRequest MakeBatch(const std::string& name, const std::vector<float>& positions,
                            const GatherOptions& options);

/// Sends `messages` as a BuildPhotonMap call.
grpc::Status Build(v1::PhotonMapService::Stub& stub,
                   std::span<const v1::BuildPhotonMapRequest> messages,
                   v1::BuildPhotonMapResponse& response);

/// Sends one batch by GatherStream; returns the parts.
grpc::Status Stream(v1::PhotonMapService::Stub& stub, std::span<const v1::GatherRequest> batches,
                    std::vector<v1::GatherResponse>& parts);

/// A server without a socket on a brute-force builder, with a stub; its log goes to a file.
class ServerTest : public ::testing::Test {
 protected:
  ServerTest();
  ~ServerTest() override;

  /// Starts with options() and `builder`.
  void Start(std::unique_ptr<Builder> builder = MakeBruteForceBuilder());

  /// Builds a map of `photons`, which must succeed.
  v1::PhotonMap MustBuild(const std::string& name, const Photons& photons);

  /// Builds a map `new_name` from the photons of the newest `name`, which must succeed.
  void MustRebuild(const std::string& name, const std::string& new_name);

  /// The lines of the log so far; ends the server first.
  std::vector<std::string> EndAndReadLog();

  /// What a brute force gathers directly.
  static GatherResult Expected(const Photons& photons, const std::vector<float>& positions,
                               const GatherOptions& options);

  server::ServerOptions options_;  ///< for Start(); in process, log in a temporary file
  std::unique_ptr<server::Server> server_;
  std::unique_ptr<v1::PhotonMapService::Stub> stub_;
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_SERVER_FIXTURE_H_
