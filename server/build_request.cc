#include "server/build_request.h"

#include <chrono>
#include <memory>
#include <string>
#include <string_view>

#include "fmt/format.h"
#include "google/protobuf/text_format.h"
#include "server/break_switch.h"
#include "server/map_store.h"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::server {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

std::string Print(const Message& message, const FieldDescriptor& field) {
  if (field.has_presence() && !message.GetReflection()->HasField(message, &field)) return "absent";
  std::string text;
  google::protobuf::TextFormat::PrintFieldValueToString(message, &field, -1, &text);
  return text;
}

/// "options.rounds was 3, now 4"; empty where nothing differs. The messages are of one type and
/// have no repeated fields.
std::string FirstDifference(const Message& first, const Message& repeat) {
  const auto& type = *first.GetDescriptor();
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor& field = *type.field(i);
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      const std::string inside =
          FirstDifference(first.GetReflection()->GetMessage(first, &field),
                          repeat.GetReflection()->GetMessage(repeat, &field));
      if (!inside.empty()) return field.name() + "." + inside;
      continue;
    }
    const std::string was = Print(first, field), now = Print(repeat, field);
    if (was != now) return fmt::format("{} was {}, now {}", field.name(), was, now);
  }
  return {};
}

std::uint64_t TimeToLiveMs(const StoredMap& map) {
  if (!map.expires) return 0;
  return static_cast<std::uint64_t>(
      std::chrono::duration_cast<std::chrono::milliseconds>(*map.expires - map.created).count());
}

// What is known of the request of `map` without it, the rest as in `repeat`.
v1::BuildHeader Guess(const StoredMap& map, const v1::BuildHeader& repeat) {
  v1::BuildHeader request = repeat;
  request.set_name(map.name);
  request.set_photon_count(map.gatherer->photon_count());
  request.set_has_powers(map.gatherer->has_powers());
  request.set_has_directions(map.gatherer->has_directions());
  request.set_time_to_live_ms(TimeToLiveMs(map));
  return request;
}
v1::RebuildPhotonMapRequest Guess(const StoredMap& map, const v1::RebuildPhotonMapRequest& repeat) {
  v1::RebuildPhotonMapRequest request = repeat;
  const std::string& name = repeat.new_name().empty() ? repeat.name() : repeat.new_name();
  if (name != map.name) request.set_new_name(map.name);
  request.set_time_to_live_ms(TimeToLiveMs(map));
  return request;
}

/// `where` stands before the fields of `repeat`.
template <typename Request>
absl::Status Compare(const StoredMap& first, const Request& repeat, std::string_view where) {
  std::string difference = "it was of another kind of call";
  if (Request request; first.request.value().empty()) {
    difference = FirstDifference(Guess(first, repeat), repeat);
    if (!difference.empty()) difference.insert(0, where);
  } else if (first.request.UnpackTo(&request)) {
    difference = FirstDifference(request, repeat);
    if (!difference.empty()) difference.insert(0, where);
  }
  if (difference.empty()) return absl::OkStatus();
  return absl::InvalidArgumentError(
      fmt::format("{}request_id is '{}', by which map '{}@{}' was built from another request: {}; "
                  "repeat that one unchanged, or give this one an id of its own",
                  where, first.request_id, first.name, first.version, difference));
}

}  // namespace

BuildRequest KeepRequest(const Message& request) {
  const std::unique_ptr<Message> known(request.New());
  known->CopyFrom(request);
  known->DiscardUnknownFields();
  BuildRequest kept;
  kept.PackFrom(*known);
  return kept;
}

bool IsBuildRequest(const BuildRequest& request) {
  v1::BuildHeader header;
  v1::RebuildPhotonMapRequest rebuild;
  return request.UnpackTo(&header) || request.UnpackTo(&rebuild);
}

absl::Status CheckRepeat(const StoredMap& first, const BuildRequest& repeat) {
  if (Broken("other_request")) return absl::OkStatus();
  if (v1::BuildHeader header; repeat.UnpackTo(&header)) return Compare(first, header, "header.");
  v1::RebuildPhotonMapRequest rebuild;
  repeat.UnpackTo(&rebuild);
  return Compare(first, rebuild, "");
}

}  // namespace treelight::server
