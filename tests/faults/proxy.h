#ifndef TREELIGHT_TESTS_FAULTS_PROXY_H_
#define TREELIGHT_TESTS_FAULTS_PROXY_H_

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "tests/faults/recorder.h"

namespace treelight::faults {

/// Stands between clients and server on 127.0.0.1, so that connections can be cut, also in the
/// middle of a message, and answers delayed. Clients that connect while there is no server wait.
class Proxy {
 public:
  struct Options {
    /// Bytes of an answer that go on at once, and the pause after them; 0: all of them.
    std::size_t piece_bytes = 0;
    std::chrono::milliseconds pause{};
  };

  /// Cuts are written down in `recorder`, which must outlive it.
  Proxy(Recorder& recorder, Options options);
  ~Proxy();

  std::string address() const;

  /// Port of the server that new connections go to; 0: there is none, and all that are open are
  /// cut.
  void SetServer(int port);

  /// Cuts one of the connections, chosen by `choice`, once `bytes` more have gone the way of the
  /// answers, or of the requests. False where there is no connection.
  bool Cut(std::uint32_t choice, bool answers, std::int64_t bytes);

 private:
  struct Connection;
  void Accept();
  void Pump(Connection& connection, bool answers);

  Recorder& recorder_;
  const Options options_;
  int listener_ = -1, port_ = 0;
  std::atomic<int> server_port_ = 0;
  std::atomic<bool> over_ = false;
  std::mutex mutex_;
  std::list<std::unique_ptr<Connection>> connections_;  // guarded by mutex_
  std::thread acceptor_;
};

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_PROXY_H_
