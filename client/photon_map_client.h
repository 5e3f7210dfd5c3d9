#ifndef TREELIGHT_CLIENT_PHOTON_MAP_CLIENT_H_
#define TREELIGHT_CLIENT_PHOTON_MAP_CLIENT_H_

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/gatherer.h"
#include "core/model/photons.h"
#include "grpcpp/channel.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::client {

/// How bytes travel to the server.
enum class Transport {
  kPlaintext,  ///< unencrypted: for loopback and Unix sockets
  kTls,
};

/// How to reach a server that asks for more than an address.
struct ConnectionOptions {
  Transport transport = Transport::kPlaintext;
  std::string tls_ca{};           ///< PEM file of the CAs of the server; empty: the system's
  std::string tls_certificate{};  ///< PEM file that shows who calls, with its CAs; empty: none
  std::string tls_key{};          ///< PEM file of its key
  std::string token_file{};       ///< one line, as `treelightd token` prints it; empty: none
  /// Whether the token may go unencrypted to another machine.
  bool send_token_in_plaintext = false;
};

/// One version of a map on the server. Version 0 means the newest at the time of the call.
struct MapRef {
  std::string name{};
  std::uint64_t version = 0;
};

struct UploadOptions {
  v1::BuildOptions build{};                  ///< zeros: the server's defaults
  std::chrono::milliseconds time_to_live{};  ///< 0: the map stays
  std::string request_id{};  ///< empty: a random one, so that a retry inside the library is safe
  /// Called after every chunk with photons sent so far, on the calling thread; a retry begins anew.
  std::function<void(std::uint64_t photons_sent)> progress{};
};

/// What another map from the same photons is like.
struct RebuildOptions {
  std::string name{};                        ///< empty: that of the source
  v1::BuildOptions build{};                  ///< zeros: the server's defaults
  std::chrono::milliseconds time_to_live{};  ///< 0: the map stays
  std::string request_id{};  ///< empty: a random one, so that a retry inside the library is safe
};

/// What an approximate answer tells of its errors; see GatherResult::error_bounds.
struct ErrorSummary {
  std::uint64_t inexact_count = 0;  ///< queries whose bound is not 0
  float largest_bound = 0;          ///< of all queries, may be +inf
};

/// How queries and answers travel. The defaults lose nothing.
struct WireOptions {
  /// Positions as 16-bit offsets in the box of each message, normals as two 16-bit numbers.
  bool quantize_queries = false;
  v1::FloatFormat answer_floats = v1::FLOAT_FORMAT_FLOAT32;  ///< of radii, distances and densities
};

/// What travelled for a batch, and what that took from the answer; see v1::WireReport.
struct WireSummary {
  std::uint64_t request_bytes = 0, answer_bytes = 0;  ///< messages
  float largest_move = 0;         ///< of a query, scene units; 0: none was moved
  float relative_error = 0;       ///< of numbers that came as halves, but of small ones
  std::uint64_t small_count = 0;  ///< numbers other than 0 that are too small for that
};

/// Answer of a batch, and which version gave it.
struct GatherAnswer {
  GatherResult result{};  ///< with error bounds only where kOutputErrorBound was asked for
  ErrorSummary errors{};  ///< zeros of an exact answer
  WireSummary wire{};
  /// Of an answer that may be gathered from fewer photons, else empty; of several batches, that of
  /// the one with the largest measured error.
  v1::MergeReport merge_report{};
  std::string
      search{};  ///< which search the server took, and why; of several batches, of the first
  MapRef map{};
  v1::Timings timings{};  ///< as the server measured them; of several batches, the sum
};

/// Blocking client of the Treelight service. Safe to call from several threads at once.
///
/// Every call returns the server's status: the code and message that photon_map.proto documents;
/// UNAVAILABLE where no server answers. `timeout` bounds each call; zero means none.
///
/// A server that has no room at present refuses with RESOURCE_EXHAUSTED and says when to repeat;
/// one that ends, or is not there, makes calls break. All calls but DeletePhotonMap then wait and
/// repeat by themselves, as long as the timeout allows and at most RetryPatience() together, what
/// breaks four times within about a second; GatherPipeline does not. Builds have a request id,
/// which makes that safe. The last error is returned; a refusal has the limit, what was asked and
/// when to repeat.
///
/// Every call tells of which map it is (metadata x-treelight-map), by which a balancer chooses one
/// of several servers: docs/replicas.md.
class PhotonMapClient {
 public:
  /// `target` as gRPC takes it, "127.0.0.1:7543" or "unix:/run/treelight.sock", reached as
  /// `options` say. Reads their files, and does not connect yet. PERMISSION_DENIED: a file cannot
  /// be read. INVALID_ARGUMENT: a file is no PEM or no token, a certificate has no key, or the
  /// token would leave this machine unencrypted.
  static absl::StatusOr<std::unique_ptr<PhotonMapClient>> Connect(
      const std::string& target, const ConnectionOptions& options,
      std::chrono::milliseconds timeout = {});

  /// In plaintext, without a token. Does not connect yet.
  explicit PhotonMapClient(const std::string& target, std::chrono::milliseconds timeout = {});
  /// On a channel of the caller's, an in-process one for example.
  explicit PhotonMapClient(std::shared_ptr<grpc::Channel> channel,
                           std::chrono::milliseconds timeout = {});
  ~PhotonMapClient();

  /// How long calls may wait for a server without room, all pauses of one call together; zero: they
  /// are not repeated. 30 s at first. Not safe while another thread calls.
  void SetRetryPatience(std::chrono::milliseconds patience);
  std::chrono::milliseconds RetryPatience() const;

  absl::StatusOr<v1::ServerInfo> GetServerInfo();
  absl::StatusOr<std::vector<v1::PhotonMap>> ListPhotonMaps();
  absl::StatusOr<v1::PhotonMap> GetPhotonMap(const MapRef& map);
  absl::StatusOr<std::uint32_t> DeletePhotonMap(const MapRef& map);  ///< versions deleted

  /// Uploads `photons` in chunks and builds a map named `name`.
  absl::StatusOr<v1::BuildPhotonMapResponse> BuildPhotonMap(const std::string& name,
                                                            const Photons& photons,
                                                            const UploadOptions& options = {});

  /// Builds another map from the photons of `source`, which the server has.
  absl::StatusOr<v1::BuildPhotonMapResponse> RebuildPhotonMap(const MapRef& source,
                                                              const RebuildOptions& options = {});

  /// Answers a batch of any size: it goes to the server in parts over one stream, and the parts are
  /// put together. All parts are answered by one version. INVALID_ARGUMENT also where queries are
  /// to be quantised that cannot be: positions beyond kMaxCoordinate, normals without a length.
  absl::StatusOr<GatherAnswer> Gather(const MapRef& map, const GatherQueries& queries,
                                      const GatherOptions& options, const WireOptions& wire = {});

 private:
  friend class GatherPipeline;
  struct Impl;
  absl::StatusOr<GatherAnswer> GatherOnce(const MapRef& map, const GatherQueries& queries,
                                          const GatherOptions& options, const WireOptions& wire,
                                          std::chrono::system_clock::time_point deadline);
  std::unique_ptr<Impl> impl_;
};

/// A stream of batches: the caller prepares the next batch while the server answers the last, so
/// neither waits. Not thread-safe. A batch must fit one message (ServerLimits); its answer may be
/// of any size.
class GatherPipeline {
 public:
  /// Opens a stream on `client`, which must outlive it.
  GatherPipeline(PhotonMapClient& client, MapRef map, GatherOptions options, WireOptions wire = {});
  ~GatherPipeline();  ///< cancels what was not received

  /// Sends a batch; blocks while the server is more than its read-ahead behind. Returns the error
  /// of the stream.
  absl::Status Send(const GatherQueries& queries);
  /// Waits for the answer of the oldest batch that was sent and not received. FAILED_PRECONDITION:
  /// there is none.
  absl::StatusOr<GatherAnswer> Receive();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_PHOTON_MAP_CLIENT_H_
