#include "client/commands/build_options.h"

#include <cstdint>
#include <vector>

#include "client/build_names.h"
#include "client/commands/check.h"
#include "fmt/format.h"
#include "fmt/ranges.h"

namespace treelight::client {
namespace {

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

}  // namespace

v1::BuildOptions BuildChoice::Options() const {
  v1::BuildOptions chosen = options;
  if (builder.empty()) return chosen;
  SetBuilder(builder, chosen);
  if (options.heuristic() != v1::HEURISTIC_UNSPECIFIED &&
      options.heuristic() != chosen.heuristic()) {
    throw CLI::ValidationError("--heuristic",
                               fmt::format("--builder {} is a sweep by {}", builder, builder));
  }
  return chosen;
}

void AddBuildOptions(CLI::App& command, BuildChoice& choice) {
  command
      .add_option("--builder", choice.builder,
                  fmt::format("{}; the last three are sweeps by a heuristic (default: the "
                              "server's, lbvh)",
                              fmt::join(BuilderNames(), ", ")))
      ->check(CLI::IsMember(BuilderNames()))
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
