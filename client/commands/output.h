#ifndef TREELIGHT_CLIENT_COMMANDS_OUTPUT_H_
#define TREELIGHT_CLIENT_COMMANDS_OUTPUT_H_

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "google/protobuf/message.h"

namespace treelight::client {

/// Prints `message` to stdout as JSON in protobuf's mapping: names as in photon_map.proto, zeros
/// included, 64-bit integers as strings. INTERNAL: protobuf cannot.
absl::Status PrintJson(const google::protobuf::Message& message);

/// A UTC time for people: "2026-01-31 23:59:59", from milliseconds since 1970.
std::string FormatTime(std::int64_t unix_ms);

/// Says on stderr, in one line, what went wrong beside the work that was asked for.
void Warn(std::string_view message);

/// Writes out what stdout still holds. RESOURCE_EXHAUSTED and the like: it cannot take all that was
/// printed; the message says why.
absl::Status FlushStdout();

/// Makes the folder `path` where there is none, with those above it. The system's error, with the
/// path.
absl::Status MakeFolder(const std::string& path);

/// `text` on one line: control characters become blanks.
std::string OneLine(std::string_view text);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_OUTPUT_H_
