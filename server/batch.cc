#include "server/batch.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "core/merged_gather.h"
#include "fmt/format.h"
#include "server/answer.h"
#include "server/break_switch.h"
#include "server/convert.h"
#include "server/gather_together.h"
#include "server/guard.h"
#include "server/merged_map_of.h"
#include "server/room.h"

namespace treelight::server {
namespace {

constexpr std::uint64_t kNeighborBytes = sizeof(std::uint32_t) + sizeof(float);
/// What a CPU searches an uncapped list in, for each neighbour at most: two pairs of arrays that
/// grow to a power of two, and what they are sorted by. Queries that are searched at once find no
/// more than all of them.
constexpr std::uint64_t kSearchBytes = 2 * 2 * kNeighborBytes + sizeof(std::uint64_t);

std::uint64_t Sum(const std::vector<std::uint32_t>& numbers) {
  return std::accumulate(numbers.begin(), numbers.end(), std::uint64_t{0});
}

}  // namespace

Batch::Batch(State& state, Call& call, AnswerForm form)
    : state_(state), call_(call), form_(form), record_(call.NewRecord()) {}

void Batch::Run(const v1::GatherRequest& request, Done done) {
  Describe(request);
  if (!call_.admission().ok()) return done(call_.admission());
  if (auto status = call_.CheckRoute(request.map()); !status.ok()) return done(status);
  // As it came, and as it is parsed.
  const auto admitted =
      TakeMemory(Holder::kMessages, record_.bytes_in + BatchBytes(request), message_memory_);
  if (!admitted.ok()) return done(admitted);
  call_.RequestCounted();
  WithNewestMaps(state_, [this, &request, done = std::move(done)] {
    state_.RunOnCpu(record_.bytes_in, [this, &request, done] {
      const auto parsed = Guard([this, &request] { return Parse(request); });
      if (!parsed.ok()) return done(parsed);
      GatherNext(done);
    });
  });
}

void Batch::GatherNext(Done done) {
  if (slice_.last > 0) GrowSlice();
  const ReloadableMap* const reloadable = map_->reloadable;
  if (reloadable == nullptr || tree_ != nullptr) return GatherSlice(done);
  // A job of its own, whose time says nothing of gathers. Only the first of those that wait for one
  // tree asks for the time of a build; once it is done the others find the tree.
  const auto load = reloadable->ExpectLoad();
  const Work work =
      load == nullptr ? Work{} : Work::Build(reloadable->photon_count(), map_->options.builder);
  const auto submitted = state_.device_queue.Submit(
      [this] { return call_.Alive(); },
      [this, reloadable, done, load](const absl::Status& turn, double queue_us) {
        record_.timings.set_queue_us(record_.timings.queue_us() + queue_us);
        if (!turn.ok()) return done(turn);
        const auto status = call_.Explain(Guard([&] {
          auto tree = reloadable->Acquire(call_.cancelled());
          if (tree.ok()) tree_ = *std::move(tree);
          return tree.status();
        }));
        if (!status.ok()) return done(status);
        GatherSlice(done);
      },
      {.work = work, .deadline = call_.deadline(), .call = &call_});
  if (!submitted.ok()) done(submitted);
}

void Batch::GatherSlice(const Done& done) {
  slice_ = {slice_.last, std::min(slice_.last + slice_size_, batch_.size())};
  const auto queries = batch_.queries(slice_.first, slice_.last);
  const std::string together = TogetherKey(*map_->gatherer, queries, batch_.options);
  done_ = done;
  const auto submitted = state_.device_queue.Submit(
      [this] { return call_.Alive(); },
      [this, alone = together.empty()](const absl::Status& turn, double queue_us) {
        v1::Timings& timings = record_.timings;
        timings.set_queue_us(timings.queue_us() + queue_us);
        if (!turn.ok()) return End(turn);
        if (alone) return GatherAlone();
        state_.going.push_back(this);
      },
      {.work = Work::Gather(batch_.options.k, slice_.last - slice_.first),
       .deadline = call_.deadline(),
       .call = &call_,
       .together = together,
       .launch = [&state = state_] { Launch(state); }});
  if (!submitted.ok()) End(submitted);
}

/// Ends a step; this object may be gone after it.
void Batch::End(const absl::Status& status) { std::exchange(done_, {})(status); }

void Batch::GatherAlone() {
  const Stopwatch held;
  const auto status = call_.Explain(Guard([this] { return Gather(); }));
  Held(held.microseconds());
  End(status);
}

/// Takes note of the time for which the device was this batch's.
void Batch::Held(double microseconds) {
  slice_us_ = microseconds;
  record_.device_us = record_.device_us.value_or(0) + slice_us_;
}

/// Gathers the slices of all batches that go together.
void Batch::Launch(State& state) {
  const std::vector<Batch*> going = std::exchange(state.going, {});
  if (going.size() == 1) return going.front()->GatherAlone();
  std::vector<GatherQueries> queries;
  for (const Batch* batch : going) {
    queries.push_back(batch->batch_.queries(batch->slice_.first, batch->slice_.last));
  }
  const CancelCheck cancelled = [&going] {
    return std::ranges::none_of(going, [](const Batch* b) { return b->call_.Alive().ok(); });
  };
  const Batch& first = *going.front();
  const Stopwatch held;
  std::vector<GatherResult> parts;
  const auto status = Guard([&] {
    auto gathered = GatherTogether(*first.map_->gatherer, queries, first.batch_.options, cancelled);
    if (gathered.ok()) parts = *std::move(gathered);
    return gathered.status();
  });
  const double held_us = held.microseconds();
  // What fails together may succeed alone; what nobody waits for says so.
  for (std::size_t i = 0; i < going.size(); ++i) {
    Batch& batch = *going[i];
    if (!status.ok()) {
      batch.GatherAlone();
      continue;
    }
    batch.record_.launch_batches = going.size();
    batch.Held(held_us);
    batch.Take(std::move(parts[i]));
    batch.End(batch.call_.Alive());
  }
}

/// What the log tells of a batch, also of one that is refused.
void Batch::Describe(const v1::GatherRequest& request) {
  record_.map = request.map();
  record_.device = state_.device_name();
  record_.batch_id = request.batch_id();
  record_.queries = QueryCount(request);
  record_.k = request.k();
  record_.radius = request.has_radius() ? request.radius() : std::numeric_limits<float>::infinity();
  record_.own_radii = !request.radii().empty();
  if (request.has_approximation()) record_.approximation = request.approximation();
  record_.quantized = request.has_quantized();
  record_.answer_floats = request.answer_floats();
  record_.bytes_in = request.ByteSizeLong();
}

absl::Status Batch::Parse(const v1::GatherRequest& request) {
  if (auto status = CheckName("map", request.map()); !status.ok()) return status;
  const auto map = state_.store.Find(request.map(), request.version());
  if (!map.ok()) return map.status();
  map_ = *map;
  if (map_->reloadable != nullptr) tree_ = map_->reloadable->Hold();  // it stays until the answer
  record_.version = map_->version;
  record_.device = map_->gatherer->report().device;
  auto batch = ParseGather(request, *map_->gatherer, state_.options.limits);
  if (!batch.ok()) return batch.status();
  batch_ = *std::move(batch);
  const Limits& limits = state_.options.limits;
  if (form_ == AnswerForm::kMessage) {
    const auto status = CheckFitsMessage(batch_.options, batch_.answer_floats, batch_.size(),
                                         map_->gatherer->photon_count(), limits);
    if (!status.ok()) return status;
  }
  // Here for lists of k, before the batch waits for the device; lists without a cap are counted
  // there.
  batch_.options.max_neighbors = limits.max_neighbors;
  const bool lists = (batch_.options.outputs & kOutputNeighbors) != 0;
  const auto fits = CheckNeighborCount(lists ? std::uint64_t{batch_.options.k} * batch_.size() : 0,
                                       batch_.options);
  return fits.ok() ? AdmitAnswer() : fits;
}

absl::Status Batch::TakeMemory(Holder holder, std::uint64_t bytes, MemoryBudget::Share& share) {
  const std::string what = fmt::format("batch of {} queries, k {}", *record_.queries, *record_.k);
  auto taken = TakeForCall(state_, holder, bytes, what);
  if (!taken.ok()) return taken.status();
  share = *std::move(taken);
  return absl::OkStatus();
}

/// Cuts the batch into slices and takes the memory for the first. Lists without a cap are of
/// unknown length: they are not cut, and paid for where they are gathered.
absl::Status Batch::AdmitAnswer() {
  const Limits& limits = state_.options.limits;
  const bool whole = form_ == AnswerForm::kMessage || batch_.options.k == 0 || Broken("slices");
  const std::uint64_t first_bytes = std::min(limits.max_part_bytes, limits.max_slice_bytes);
  slice_size_ = whole ? batch_.size() : std::max<std::uint64_t>(1, first_bytes / QueryBytes());
  return TakeMemory(Holder::kAnswers, HeldBytes(slice_size_), answer_memory_);
}

/// The client has taken a slice: the next is twice as large, where there is memory for it and it
/// does not keep others from the device for long.
void Batch::GrowSlice() {
  constexpr double kLongestUs = 100'000;
  if (2 * slice_us_ > kLongestUs) return;
  const std::uint64_t largest = state_.options.limits.max_slice_bytes / QueryBytes();
  const std::uint64_t grown = std::min<std::uint64_t>({2 * slice_size_, largest, batch_.size()});
  if (grown <= slice_size_) return;
  const std::uint64_t held = HeldBytes(grown);
  const auto more = state_.memory.Take(Holder::kAnswers, held - answer_memory_.bytes(),
                                       "a larger slice", state_.device_queue.RetryDelay());
  if (!more.ok()) return;
  answer_memory_.Resize(held);
  slice_size_ = grown;
}

/// Bytes of the arrays of the answer to one query, at most, as they are gathered.
std::uint64_t Batch::QueryBytes() const {
  return std::max<std::uint64_t>(1, LargestAnswer(batch_.options, v1::FLOAT_FORMAT_FLOAT32, 1, 0));
}

/// What a slice of `query_count` holds: itself, and a part that is there twice, made and on its way
/// in gRPC.
std::uint64_t Batch::HeldBytes(std::size_t query_count) const {
  const Limits& limits = state_.options.limits;
  const std::uint64_t slice_bytes = QueryBytes() * std::min(query_count, batch_.size());
  return slice_bytes + std::min(slice_bytes, form_ == AnswerForm::kMessage
                                                 ? limits.max_message_bytes
                                                 : 2 * limits.max_part_bytes);
}

absl::Status Batch::Gather() {
  const bool lists = batch_.options.k == 0 && (batch_.options.outputs & kOutputNeighbors) != 0;
  MemoryBudget::Share list_memory;
  if (lists) {
    // No list is longer than the map.
    const std::uint64_t longest = (slice_.last - slice_.first) * map_->gatherer->photon_count();
    const std::uint64_t bytes = kNeighborBytes + (state_.maps_in_host_memory() ? kSearchBytes : 0);
    const auto taken = TakeMemory(
        Holder::kAnswers, bytes * std::min<std::uint64_t>(longest, batch_.options.max_neighbors),
        list_memory);
    if (!taken.ok()) return taken;
  }
  result_ = {};  // the last slice goes before the next comes
  auto result = GatherQueriesOf(slice_);
  if (!result.ok()) return result.status();
  Take(*std::move(result));
  if (lists) {
    answer_memory_.Resize(answer_memory_.bytes() + kNeighborBytes * result_.neighbor_ids.size());
  }
  return absl::OkStatus();
}

absl::StatusOr<GatherResult> Batch::GatherQueriesOf(const Slice& slice) {
  if (batch_.options.approximation.merges() && !choice_) {
    if (auto status = Choose(); !status.ok()) return status;
  }
  const GatherQueries queries = batch_.queries(slice.first, slice.last);
  if (!choice_) return map_->gatherer->Gather(queries, batch_.options, call_.cancelled());
  if (choice_->exact()) {
    return GatherExactly(*map_->gatherer, *choice_, queries, batch_.options, call_.cancelled());
  }
  return GatherMerged(*map_->gatherer, choice_->merged, queries, batch_.options, call_.cancelled());
}

/// Chooses how few photons it is gathered from, by a sample of the whole batch.
absl::Status Batch::Choose() {
  const auto merged = [this](const FewerPhotons& fewer) {
    return MergedMapOf(state_, *map_, fewer, call_.cancelled());
  };
  const auto costs = [this](GatherKind kind) -> absl::StatusOr<GatherCosts> {
    if (kind == GatherKind::kWhole && state_.maps_in_host_memory()) {
      return absl::ResourceExhaustedError("moments of maps are in no budget of the host");
    }
    MemoryBudget::Share memory;
    const std::uint64_t bytes = state_.gather_costs.WorkBytes(kind);
    if (auto status = TakeMemory(Holder::kAnswers, bytes, memory); !status.ok()) return status;
    return state_.gather_costs.Find(kind, call_.cancelled());
  };
  auto choice = ChooseMerge(*map_->gatherer, merged, costs, batch_.queries(0, batch_.size()),
                            batch_.options, call_.cancelled());
  if (!choice.ok()) return choice.status();
  AddTimes(choice->times);
  choice_ = *std::move(choice);
  record_.merge_report = ToWire(*choice_);
  return absl::OkStatus();
}

/// The answers of a slice.
void Batch::Take(GatherResult result) {
  result_ = std::move(result);
  const auto& distances = result_.neighbor_squared_distances;
  if (Broken("ties") && distances.size() > 1 && distances[0] == distances[1]) {
    std::swap(result_.neighbor_ids[0], result_.neighbor_ids[1]);
  }
  if (Broken("distance")) {
    for (float& squared : result_.neighbor_squared_distances) squared *= 1 + 0x1p-20f;
  }
  if (Broken("density")) {
    for (float& sum : result_.densities) sum *= 1.001f;
  }
  AddTimes(result_.times);
  record_.search = choice_ && !choice_->exact() ? "of fewer photons, " : "";
  record_.search += result_.search;
  if ((batch_.options.outputs & kOutputStatistics) == 0) return;
  record_.nodes_visited = record_.nodes_visited.value_or(0) + Sum(result_.nodes_visited);
  record_.distance_tests = record_.distance_tests.value_or(0) + Sum(result_.distance_tests);
}

void Batch::AddTimes(const GatherTimes& times) {
  v1::Timings& timings = record_.timings;
  timings.set_upload_us(timings.upload_us() + times.upload_us);
  timings.set_kernel_us(timings.kernel_us() + times.kernel_us);
  timings.set_download_us(timings.download_us() + times.download_us);
}

absl::Status Batch::WriteNext(v1::GatherResponse& response) {
  const Stopwatch watch;
  const std::size_t first = next_query_ - slice_.first, count = slice_.last - slice_.first;
  const auto last = form_ == AnswerForm::kMessage
                        ? count
                        : FindPartEnd(result_, batch_.options, batch_.answer_floats, count, first,
                                      state_.options.limits);
  if (!last.ok()) return last.status();
  response.set_batch_id(*record_.batch_id);
  response.set_map(map_->name);
  response.set_version(map_->version + (Broken("other_version") ? 1 : 0));
  WritePart(result_, batch_.options, batch_.answer_floats, first, *last, response);
  if (batch_.largest_move > 0) {
    response.set_approximate(true);
    response.mutable_wire_report()->set_largest_move(batch_.largest_move);
  }
  response.set_first_query(static_cast<std::uint32_t>(next_query_));
  if (record_.merge_report) *response.mutable_merge_report() = *record_.merge_report;
  next_query_ = slice_.first + *last;
  v1::Timings& timings = record_.timings;
  timings.set_serialise_us(timings.serialise_us() + watch.microseconds());
  if (complete()) {
    timings.set_total_us(watch_.microseconds());
    response.set_last(true);
    *response.mutable_timings() = timings;
    response.set_search(record_.search);
    result_ = {};  // gRPC makes another copy of the answer
  }
  record_.bytes_out += response.ByteSizeLong();
  return absl::OkStatus();
}

std::size_t Batch::next_bytes() const {
  const std::uint64_t neighbors = result_.neighbor_ids.size();
  const std::uint64_t bytes =
      LargestAnswer(batch_.options, batch_.answer_floats, slice_.last - slice_.first, 0) +
      (batch_.options.k == 0 ? 8 * neighbors : 0);
  return std::min<std::uint64_t>(bytes, state_.options.limits.max_part_bytes);
}

void Batch::Log(const absl::Status& status) {
  if (!complete() || !status.ok()) record_.timings.set_total_us(watch_.microseconds());
  call_.Log(record_, status);
}

}  // namespace treelight::server
