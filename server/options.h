#ifndef TREELIGHT_SERVER_OPTIONS_H_
#define TREELIGHT_SERVER_OPTIONS_H_

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/builder.h"

namespace treelight::server {

/// What one request may ask for; GetServerInfo tells them to clients (ServerLimits in
/// photon_map.proto).
struct Limits {
  std::uint64_t max_message_bytes = 4 << 20;  ///< in either direction
  std::uint64_t max_chunk_bytes = 1 << 20;    ///< arrays of one PhotonChunk together
  std::uint64_t max_part_bytes = 1 << 20;     ///< aimed at for one part of a stream's answer
  std::uint64_t max_photons = 100'000'000;    ///< in one map
  /// In one batch. The default fills a message with positions, radii and normals: 28 B a query.
  std::uint32_t max_queries = 131'072;
  std::uint64_t max_neighbors = 1 << 25;  ///< in the whole answer of one batch with NEIGHBORS
  /// Of a batch with k > 0 in a stream: aimed at for what is gathered ahead of what the client has
  /// taken. A larger batch goes to the device in slices.
  std::uint64_t max_slice_bytes = 16 << 20;
};

/// Files of TLS, PEM each. Changed ones are taken up while the server runs.
struct TlsFiles {
  std::string certificate{};  ///< of the server, followed by those between it and its CA
  std::string key{};          ///< of `certificate`, without a password
  std::string client_ca{};    ///< clients must show a certificate of it; empty: they need none

  bool empty() const { return certificate.empty() && key.empty() && client_ca.empty(); }
};

/// How a server runs.
struct ServerOptions {
  /// "host:port" with port 0 for a free one, or "unix:/path"; empty: in-process channels only.
  std::string listen = "127.0.0.1:7543";
  /// Whether `listen` may be other than loopback or a Unix socket without TLS and tokens, and
  /// `metrics_listen`, which has neither, other than loopback.
  bool allow_insecure = false;
  TlsFiles tls;                  ///< empty: nothing is encrypted
  std::string token_file;        ///< hashes of the tokens of those who may call; empty: all may
  unsigned socket_mode = 0600;   ///< of a Unix socket's file: who may write may call
  std::size_t max_calls = 1024;  ///< that may be open at once, at least 1
  /// Connections that may be open at once, at least 1; fewer where the process has no files for
  /// them.
  std::size_t max_connections = 4096;
  std::size_t queue_depth = 64;  ///< requests that may wait for the device, at least 1
  std::size_t build_slots = 16;  ///< builds that may be open, at least 1
  /// Host memory for photons that arrive, messages, answers, and maps of a CPU device, bytes;
  /// 0: DefaultMemoryLimit().
  std::uint64_t memory_limit = 0;
  /// How long a client may stand still in the middle of an upload or of an answer, at least 1 ms.
  std::chrono::milliseconds stall = std::chrono::seconds(60);
  /// Folder in which maps survive the server; empty: they live in memory alone.
  std::string data_folder;
  std::string log_file;  ///< of the request log; empty: stderr
  /// Requests that take longer are marked in the log and counted; 0: none.
  std::chrono::milliseconds slow{};
  /// "host:port" of GET /metrics, as `listen`; empty: nowhere.
  std::string metrics_listen;
  Limits limits;
  std::vector<DeviceInfo>
      devices;           ///< of the machine; empty: not known, then no device limit is checked
  int device_index = 0;  ///< which of `devices` the builder works on
};

/// INVALID_ARGUMENT: a file is missing beside the others.
absl::Status CheckTlsOptions(const TlsFiles& tls);

/// INVALID_ARGUMENT names the option that is wrong; also an address that other machines can reach
/// where neither TLS and tokens guard it nor `allow_insecure` is true.
absl::Status CheckOptions(const ServerOptions& options);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_OPTIONS_H_
