#ifndef TREELIGHT_TESTS_FAULTS_CLIENTS_H_
#define TREELIGHT_TESTS_FAULTS_CLIENTS_H_

#include <cstdint>
#include <memory>
#include <random>
#include <string>

#include "client/photon_map_client.h"
#include "tests/faults/board.h"
#include "tests/faults/recorder.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::faults {

/// Largest map that the servers of a run allow, photons.
inline constexpr std::uint32_t kMaxPhotons = 2500;

/// One client that asks for what chance says, by the client library, and writes down what came of
/// it. One thread at a time.
class Client {
 public:
  struct Options {
    std::uint32_t seed = 0;
    /// Queries of a large batch; 0: all are small.
    std::uint32_t large_batch = 0;
  };

  Client(Recorder& recorder, Board& board, const std::string& address, Options options);

  /// Asks for one thing.
  void Step();

  /// Lists all maps and asks for every photon of each.
  void Audit();

 private:
  BuildTry AnyBuild();
  void BuildSomething();
  void BuildWrongly();
  Outcome Build(BuildTry build);
  void DeleteSomething();
  void DeleteOne(const client::MapRef& map);
  void GatherSomething();
  void GatherFrom(const client::MapRef& map);
  void GatherAll(const client::MapRef& map);
  void Ask(const client::MapRef& map, const QuerySet& queries);
  List ListAll();

  Recorder& recorder_;
  Board& board_;
  const Options options_;
  std::mt19937 random_;
  bool unanswered_ = false;  // the last question
  const std::shared_ptr<grpc::Channel> channel_;
  client::PhotonMapClient client_;
  const std::unique_ptr<v1::PhotonMapService::Stub> stub_;
};

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_CLIENTS_H_
