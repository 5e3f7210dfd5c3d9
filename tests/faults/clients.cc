#include "tests/faults/clients.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "fmt/format.h"
#include "tests/faults/channel.h"
#include "tests/faults/model.h"

namespace treelight::faults {
namespace {

using std::chrono_literals::operator""ms;
using std::chrono_literals::operator""s;

constexpr std::size_t kManyMaps = 80;
constexpr std::chrono::milliseconds kTimeout = 4s;

Outcome ToOutcome(const absl::Status& status) {
  switch (status.code()) {
    case absl::StatusCode::kOk:
      return Outcome::kOk;
    case absl::StatusCode::kNotFound:
      return Outcome::kNotFound;
    case absl::StatusCode::kDataLoss:
      return Outcome::kDataLoss;
    case absl::StatusCode::kInvalidArgument:
    case absl::StatusCode::kResourceExhausted:
    case absl::StatusCode::kInternal:
    case absl::StatusCode::kFailedPrecondition:
      return Outcome::kRefused;
    default:
      return Outcome::kUnknown;
  }
}

std::string Told(const absl::Status& status) {
  if (status.ok()) return {};
  return fmt::format("{}: {}", absl::StatusCodeToString(status.code()),
                     std::string(status.message()));
}

}  // namespace

Client::Client(Recorder& recorder, Board& board, const std::string& address, Options options)
    : recorder_(recorder),
      board_(board),
      options_(options),
      random_(options.seed),
      channel_(MakeChannel(address)),
      client_(channel_, kTimeout),
      stub_(v1::PhotonMapService::NewStub(channel_)) {
  client_.SetRetryPatience(1s);
}

void Client::Step() {
  // While there is no server, questions are of no use.
  if (unanswered_) std::this_thread::sleep_for(50ms);
  unanswered_ = false;
  const std::uint32_t dice = random_() % 100;
  if (dice < 25) {
    BuildSomething();
  } else if (dice < 29) {
    BuildWrongly();
  } else if (dice < 38 || (dice < 50 && board_.built_count() > kManyMaps)) {
    DeleteSomething();
  } else if (dice < 54) {
    (void)ListAll();
  } else {
    GatherSomething();
  }
}

BuildTry Client::AnyBuild() {
  // Counts that tell one request from others, where a list says no more than them.
  constexpr std::uint32_t kFewest = 64, kCounts = 2003, kStride = 37;
  const std::uint32_t serial = board_.NextSerial();
  BuildTry build;
  build.request_id = fmt::format("request{}", serial);
  build.name = NameOf(random_());
  build.photons = {.count = kFewest + serial * kStride % kCounts,
                   .seed = static_cast<std::uint32_t>(random_())};
  if (random_() % 10 == 0) build.time_to_live = 1000 * (20 + random_() % 800);
  return build;
}

void Client::BuildSomething() {
  const BuildTry build = AnyBuild();
  // Asked again, as a client does that was not answered; at times one that was.
  constexpr int kTries = 3;
  for (int i = 0; i < kTries; ++i) {
    const bool again = random_() % 8 == 0, insist = random_() % 2 == 0;
    const Outcome outcome = Build(build);
    if (!(outcome == Outcome::kOk && again) && !(outcome == Outcome::kUnknown && insist)) break;
  }
  if (random_() % 8 != 0) return;
  // What another client would ask for that takes the same id.
  BuildTry other = AnyBuild();
  other.sent_id = build.request_id;
  Build(other);
}

Outcome Client::Build(BuildTry build) {
  client::UploadOptions options;
  options.request_id = build.sent_id.empty() ? build.request_id : build.sent_id;
  options.time_to_live = std::chrono::milliseconds(build.time_to_live / 1000);
  constexpr v1::BuilderKind kKinds[] = {v1::BUILDER_KIND_LBVH, v1::BUILDER_KIND_TREELET,
                                        v1::BUILDER_KIND_BALANCED};
  options.build.set_builder(kKinds[build.photons.seed % std::size(kKinds)]);
  const Photons photons = MakePhotons(build.photons);
  build.start = recorder_.Now();
  const auto built = client_.BuildPhotonMap(build.name, photons, options);
  build.end = recorder_.Now();
  build.outcome = ToOutcome(built.status());
  build.told = Told(built.status());
  if (built.ok()) {
    const v1::PhotonMap& map = built->map();
    build.answered_name = map.name();
    build.version = map.version();
    build.photon_count = map.photon_count();
    if (map.expires_unix_ms() != 0) build.expires = recorder_.FromUnixMs(map.expires_unix_ms());
    board_.Built({.name = map.name(), .version = map.version()});
  }
  const Outcome outcome = build.outcome;
  unanswered_ |= outcome == Outcome::kUnknown;
  recorder_.Add(std::move(build));
  return outcome;
}

/// An upload that breaks off, or a map over the limit.
void Client::BuildWrongly() {
  const bool too_large = random_() % 2 == 0;
  BuildTry build;
  build.request_id = fmt::format("wrong{}", board_.NextSerial());
  build.name = NameOf(random_());
  build.photons = {.count = too_large ? kMaxPhotons + 1 : 100,
                   .seed = static_cast<std::uint32_t>(random_()) | 1};
  build.must_be_refused = true;
  const Photons photons = MakePhotons(build.photons);
  v1::BuildPhotonMapRequest header, chunk;
  header.mutable_header()->set_name(build.name);
  header.mutable_header()->set_photon_count(build.photons.count + (too_large ? 0 : 1));
  header.mutable_header()->set_request_id(build.request_id);
  chunk.mutable_chunk()->set_positions(photons.positions.data(),
                                       photons.positions.size() * sizeof(float));
  build.start = recorder_.Now();
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kTimeout);
  v1::BuildPhotonMapResponse response;
  const auto upload = stub_->BuildPhotonMap(&context, &response);
  if (upload->Write(header)) upload->Write(chunk);
  upload->WritesDone();
  const grpc::Status status = upload->Finish();
  build.end = recorder_.Now();
  const absl::Status told(static_cast<absl::StatusCode>(status.error_code()),
                          status.error_message());
  build.outcome = ToOutcome(told);
  build.told = Told(told);
  build.answered_name = response.map().name();
  build.version = response.map().version();
  build.photon_count = response.map().photon_count();
  recorder_.Add(std::move(build));
}

void Client::DeleteSomething() {
  client::MapRef map = board_.AnyBuilt(random_);
  if (random_() % 8 == 0) map.version = 0;
  DeleteOne(map);
}

void Client::DeleteOne(const client::MapRef& map) {
  Delete gone{.name = map.name, .version = map.version};
  gone.start = recorder_.Now();
  const auto deleted = client_.DeletePhotonMap(map);
  gone.end = recorder_.Now();
  gone.outcome = ToOutcome(deleted.status());
  gone.told = Told(deleted.status());
  unanswered_ |= gone.outcome == Outcome::kUnknown;
  if (gone.outcome == Outcome::kOk || gone.outcome == Outcome::kNotFound) board_.Deleted(map);
  recorder_.Add(std::move(gone));
}

void Client::GatherSomething() {
  const std::uint32_t dice = random_() % 10;
  if (dice < 4) {
    GatherFrom({.name = NameOf(random_())});
  } else if (dice < 9) {
    GatherFrom(board_.AnyBuilt(random_));
  } else {
    GatherFrom(board_.AnyDeleted(random_));
  }
}

void Client::GatherFrom(const client::MapRef& map) {
  const bool large = options_.large_batch > 0 && random_() % 2 == 0;
  const bool lists = random_() % 4 == 0;  // all within a radius
  Ask(map, {.count = large ? options_.large_batch : 1 + static_cast<std::uint32_t>(random_() % 6),
            .seed = static_cast<std::uint32_t>(random_()),
            .k = lists ? 0 : 1 + static_cast<std::uint32_t>(random_() % 12),
            .radius = lists || random_() % 2 == 0 ? 0.02f * static_cast<float>(1 + random_() % 8)
                                                  : std::numeric_limits<float>::infinity()});
}

/// Asks for every photon of `map`, so that none can be wrong unnoticed.
void Client::GatherAll(const client::MapRef& map) {
  constexpr float kWholeCube = 2;
  Ask(map,
      {.count = 1, .seed = static_cast<std::uint32_t>(random_()), .k = 0, .radius = kWholeCube});
}

void Client::Ask(const client::MapRef& map, const QuerySet& queries) {
  Gather gather{.name = map.name, .version = map.version};
  gather.queries = queries;
  const auto positions = MakeQueries(gather.queries);
  gather.start = recorder_.Now();
  auto answer = client_.Gather(map, {.positions = positions}, MakeOptions(gather.queries));
  gather.end = recorder_.Now();
  gather.outcome = ToOutcome(answer.status());
  gather.told = Told(answer.status());
  unanswered_ |= gather.outcome == Outcome::kUnknown;
  if (answer.ok()) {
    gather.answered_name = answer->map.name;
    gather.answered_version = answer->map.version;
    gather.result = std::move(answer->result);
  } else if (gather.outcome == Outcome::kNotFound && map.version != 0) {
    board_.Deleted(map);
  }
  recorder_.Add(std::move(gather));
}

List Client::ListAll() {
  List list;
  list.start = recorder_.Now();
  const auto maps = client_.ListPhotonMaps();
  list.end = recorder_.Now();
  list.outcome = ToOutcome(maps.status());
  unanswered_ |= list.outcome == Outcome::kUnknown;
  if (maps.ok()) {
    for (const v1::PhotonMap& map : *maps) {
      list.maps.push_back({map.name(), map.version(), map.photon_count()});
    }
  }
  recorder_.Add(list);
  return list;
}

void Client::Audit() {
  for (const Listed& map : ListAll().maps) {
    GatherAll({.name = map.name, .version = map.version});
  }
}

}  // namespace treelight::faults
