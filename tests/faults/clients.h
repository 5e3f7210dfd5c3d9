#ifndef TREELIGHT_TESTS_FAULTS_CLIENTS_H_
#define TREELIGHT_TESTS_FAULTS_CLIENTS_H_

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "client/photon_map_client.h"
#include "tests/faults/recorder.h"
#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::faults {

/// Largest map that the servers of a run allow, photons.
inline constexpr std::uint32_t kMaxPhotons = 2500;

/// Clients that work at once, and can be made to pause.
class Gate {
 public:
  /// Waits while the gate is closed; false once all is over.
  bool Enter();
  void Leave();
  /// Lets nobody in, and waits until nobody is.
  void Close();
  void Open();
  void End();

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int inside_ = 0;                      // guarded by mutex_
  bool closed_ = false, over_ = false;  // guarded by mutex_
};

/// What clients know of the maps that are there, and of those that are not any more.
class Board {
 public:
  void Built(const client::MapRef& map);
  void Deleted(const client::MapRef& map);
  /// One of those; with version 0 where there is none.
  client::MapRef AnyBuilt(std::mt19937& random) const;
  client::MapRef AnyDeleted(std::mt19937& random) const;
  std::size_t built_count() const;
  std::uint32_t NextSerial() { return serial_++; }

 private:
  mutable std::mutex mutex_;
  std::vector<client::MapRef> built_, deleted_;  // guarded by mutex_
  std::atomic<std::uint32_t> serial_ = 0;
};

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

/// Clients that begin an upload, or ask for much, and then stand still until they are let go.
class StuckClients {
 public:
  explicit StuckClients(int port);
  ~StuckClients();  ///< lets them go

 private:
  void Upload(v1::PhotonMapService::Stub& stub);
  void Read(v1::PhotonMapService::Stub& stub);
  void WaitUntilLetGo();

  std::mutex mutex_;
  std::condition_variable let_go_;
  bool over_ = false;  // guarded by mutex_
  std::vector<std::thread> threads_;
};

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_CLIENTS_H_
