#include "client/commands/build_options.h"

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <vector>

#include "client/build_names.h"
#include "client/commands/check.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {
namespace {

constexpr char kAuto[] = "auto";

/// Adds the option `name` for a number of `options`, set by `set`.
void AddNumber(CLI::App& command, const std::string& name, BuildChoice& choice,
               void (v1::BuildOptions::*set)(std::uint32_t), std::uint32_t min, std::uint32_t max,
               const std::string& what) {
  command
      .add_option_function<std::uint32_t>(
          name, [&choice, set](const std::uint32_t& number) { (choice.options.*set)(number); },
          what)
      ->check(CLI::Range(min, max));
}

/// CLI::ValidationError: an option is given that `builder` does not read.
void CheckRead(const std::string& builder, const v1::BuildOptions& options) {
  struct Reading {
    bool given;
    const char* option;
    std::vector<std::string> readers;
  };
  const std::vector<std::string> treelets = {"treelet", "trbvh", "atrbvh"};
  const std::vector<std::string> sweeps = HeuristicNames();
  const auto with = [](std::vector<std::string> names, const std::vector<std::string>& more) {
    names.insert(names.end(), more.begin(), more.end());
    return names;
  };
  const auto by_cost = with(with({"hybrid", kAuto}, treelets), sweeps);
  const std::vector<Reading> readings = {
      {options.heuristic() != v1::HEURISTIC_UNSPECIFIED, "--heuristic", by_cost},
      {options.leaf_term() != v1::LEAF_TERM_UNSPECIFIED, "--leaf-term",
       with(by_cost, {"balanced"})},
      {options.treelet_size() > 0, "--treelet-size", treelets},
      {options.rounds() > 0, "--rounds", treelets},
      {options.subtree_size() > 0, "--subtree-size", {"hybrid"}},
      {options.morton_bits() > 0, "--morton-bits",
       with({"", "lbvh", "karras", "hybrid", kAuto}, treelets)},
      {options.expected_gathers() > 0, "--expected-gathers", {kAuto}},
      {options.has_expected_k(), "--expected-k", {kAuto}}};
  for (const auto& [given, option, readers] : readings) {
    if (!given || std::ranges::find(readers, builder) != readers.end()) continue;
    throw CLI::ValidationError(
        option, builder.empty() ? fmt::format("say --builder too: {}", fmt::join(readers, ", "))
                                : fmt::format("{} does not read it; these do: {}", builder,
                                              fmt::join(readers, ", ")));
  }
}

}  // namespace

v1::BuildOptions BuildChoice::Options() const {
  CheckRead(builder, options);
  v1::BuildOptions chosen = options;
  if (builder.empty()) return chosen;
  if (builder == kAuto) {
    chosen.set_builder(v1::BUILDER_KIND_AUTO);
    return chosen;
  }
  SetBuilder(builder, chosen);
  if (options.heuristic() != v1::HEURISTIC_UNSPECIFIED &&
      options.heuristic() != chosen.heuristic()) {
    throw CLI::ValidationError("--heuristic",
                               fmt::format("--builder {} is a sweep by {}", builder, builder));
  }
  return chosen;
}

void AddBuildOptions(CLI::App& command, BuildChoice& choice) {
  std::vector<std::string> names = {kAuto, "lbvh", "hybrid", "isa"};
  std::vector<std::string> studied;
  std::ranges::copy_if(BuilderNames(), std::back_inserter(studied), [&](const std::string& name) {
    return std::ranges::find(names, name) == names.end();
  });
  std::vector<std::string> all = names;
  all.insert(all.end(), studied.begin(), studied.end());
  command
      .add_option("--builder", choice.builder,
                  fmt::format("{} (default: the server's, lbvh). auto: lbvh or hybrid, whichever "
                              "takes less time for the build and the expected gathers on the "
                              "server's device. isa: a sweep, slow to build, for maps that are "
                              "gathered from 1e8 times and more. For studies: {}; the last two are "
                              "sweeps by these heuristics",
                              fmt::join(names, ", "), fmt::join(studied, ", ")))
      ->check(CLI::IsMember(all))
      ->type_name("NAME");
  command
      .add_option_function<std::string>(
          "--heuristic",
          [&choice](const std::string& name) {
            choice.options.set_heuristic(HeuristicNamed(name));
          },
          "What stands for the cost of a node: sah, isa or vvh (default: the server's, isa); of "
          "treelet, trbvh, atrbvh and hybrid")
      ->check(CLI::IsMember(HeuristicNames()))
      ->type_name("NAME");
  command
      .add_option_function<std::string>(
          "--leaf-term",
          [&choice](const std::string& name) {
            choice.options.set_leaf_term(name == "none" ? v1::LEAF_TERM_NONE
                                                        : v1::LEAF_TERM_LEAF_SIZE);
          },
          "Whether costs know the leaf size: leaf_size or none (default: the server's, leaf_size)")
      ->check(CLI::IsMember({"leaf_size", "none"}))
      ->type_name("NAME");
  using Options = v1::BuildOptions;
  AddNumber(command, "--treelet-size", choice, &Options::set_treelet_size, 3, 32,
            "Leaves of a treelet (default: the server's, 7): treelet 3 to 16, trbvh 3 to 9, atrbvh "
            "3 to 32");
  AddNumber(command, "--rounds", choice, &Options::set_rounds, 1, 8,
            "How often treelets are restructured (default: the server's, 3)");
  AddNumber(command, "--leaf-size", choice, &Options::set_max_leaf_size, 1, 64,
            "Photons in a leaf at most (default: the server's, 16)");
  AddNumber(command, "--subtree-size", choice, &Options::set_subtree_size, 1, 4096,
            "Photons of a subtree that hybrid rebuilds, at most (default: the server's, 256)");
  command
      .add_option_function<float>(
          "--radius", [&choice](const float& radius) { choice.options.set_radius(radius); },
          "Gather radius that isa and vvh expect, scene units (default: sampled)")
      ->check(NumberIn(0, 1e18));
  command
      .add_option_function<std::uint32_t>(
          "--morton-bits",
          [&choice](const std::uint32_t& bits) { choice.options.set_morton_bits(bits); },
          "Bits of the Morton codes (default: the server's, 30)")
      ->check(CLI::IsMember({30, 63}));
  command.add_option_function<std::uint64_t>(
      "--expected-gathers",
      [&choice](const std::uint64_t& count) { choice.options.set_expected_gathers(count); },
      "Gathers that auto chooses for (default: as many as there are photons)");
  AddNumber(command, "--expected-k", choice, &Options::set_expected_k, 0, 4096,
            "Their k, 0: all within a radius (default: 50)");
  AddNumber(command, "--seed", choice, &Options::set_seed, 0, ~std::uint32_t{0},
            "Of the photons that the radius is sampled at");
}

void AddBuildLifeOptions(CLI::App& command, BuildLife& life) {
  command
      .add_option("--ttl", life.time_to_live_s,
                  "Seconds after which the map is deleted (default: never)")
      ->check(NumberIn(0.001, 30.0 * 24 * 3600));
  command
      .add_option("--request-id", life.request_id,
                  "The same id again answers with the map built first")
      ->check(ServerName());
}

std::string DescribeOptions(const v1::PhotonMap& map) {
  const v1::BuildOptions& options = map.options();
  std::vector<std::string> parts = {map.builder().empty() ? "lbvh" : map.builder()};
  if (options.heuristic() != v1::HEURISTIC_UNSPECIFIED && NameOf(options.heuristic()) != parts[0])
    parts[0] += " by " + NameOf(options.heuristic());
  if (options.leaf_term() == v1::LEAF_TERM_LEAF_SIZE) parts[0] += " with the leaf term";
  if (options.treelet_size() > 0)
    parts.push_back(fmt::format("treelets of {} leaves, {} round{}", options.treelet_size(),
                                options.rounds(), options.rounds() == 1 ? "" : "s"));
  if (options.subtree_size() > 0)
    parts.push_back(fmt::format("subtrees of {} photons", options.subtree_size()));
  if (options.radius() > 0) parts.push_back(fmt::format("radius {:.4g}", options.radius()));
  if (options.morton_bits() > 0)
    parts.push_back(fmt::format("{} Morton bits", options.morton_bits()));
  parts.push_back(fmt::format("at most {} photons in a leaf", options.max_leaf_size()));
  return fmt::format("{}", fmt::join(parts, ", "));
}

}  // namespace treelight::client
