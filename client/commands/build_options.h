#ifndef TREELIGHT_CLIENT_COMMANDS_BUILD_OPTIONS_H_
#define TREELIGHT_CLIENT_COMMANDS_BUILD_OPTIONS_H_

#include <chrono>
#include <cstdint>
#include <string>

#include "CLI/CLI.hpp"
#include "treelight/v1/photon_map.pb.h"

namespace treelight::client {

/// What a command line says of how a tree is built; zeros: the server's defaults.
struct BuildChoice {
  std::string builder;  ///< as SetBuilder takes it, or "auto"; empty: the server's default
  v1::BuildOptions options;

  /// `options` with the builder. CLI::ValidationError: --builder names a heuristic, and --heuristic
  /// another one, or an option is given that the builder does not read.
  v1::BuildOptions Options() const;
};

/// Adds --builder, --heuristic, --leaf-term, --treelet-size, --rounds, --leaf-size, --radius,
/// --subtree-size, --morton-bits, --expected-gathers, --expected-k and --seed to `command`. They
/// are parsed to `choice`, which must outlive the parsing.
void AddBuildOptions(CLI::App& command, BuildChoice& choice);

/// What a command line says of how long a map lives, and of a build that is asked for again.
struct BuildLife {
  double time_to_live_s = 0;  ///< 0: for ever
  std::string request_id;

  std::chrono::milliseconds time_to_live() const {
    return std::chrono::milliseconds(static_cast<std::int64_t>(time_to_live_s * 1000));
  }
};

/// Adds --ttl, in seconds, and --request-id, parsed to `life`, which must outlive the parsing.
void AddBuildLifeOptions(CLI::App& command, BuildLife& life);

/// How the tree of `map` was built, for people: "treelet by isa with the leaf term, ...".
std::string DescribeOptions(const v1::PhotonMap& map);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_BUILD_OPTIONS_H_
