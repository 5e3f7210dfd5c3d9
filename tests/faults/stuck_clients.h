#ifndef TREELIGHT_TESTS_FAULTS_STUCK_CLIENTS_H_
#define TREELIGHT_TESTS_FAULTS_STUCK_CLIENTS_H_

#include <condition_variable>
#include <mutex>
#include <thread>
#include <vector>

#include "treelight/v1/photon_map.grpc.pb.h"

namespace treelight::faults {

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

#endif  // TREELIGHT_TESTS_FAULTS_STUCK_CLIENTS_H_
