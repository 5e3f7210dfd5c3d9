#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "client/commands/check.h"
#include "client/commands/command.h"
#include "client/commands/map_table.h"
#include "client/commands/output.h"
#include "client/commands/server_option.h"
#include "client/photon_map_client.h"
#include "client/photon_ply.h"
#include "client/progress.h"
#include "client/table.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

struct Options {
  std::string photons_path, name, request_id;
  std::uint32_t max_leaf_size = 0, morton_bits = 0;  // 0: the server's default
  double time_to_live_s = 0;                         // 0: for ever
  bool json = false;
};

std::string FormatTimings(const v1::Timings& timings) {
  return Format({.head = {"server", "time"},
                 .rows = {{"receive", FormatMicroseconds(timings.receive_us())},
                          {"queue", FormatMicroseconds(timings.queue_us())},
                          {"upload to the device", FormatMicroseconds(timings.upload_us())},
                          {"kernels", FormatMicroseconds(timings.kernel_us())},
                          {"in all", FormatMicroseconds(timings.total_us())}}});
}

absl::Status Run(const Options& options, const GlobalOptions& global) {
  const auto client = Connect(global);
  if (!client.ok()) return client.status();
  const auto photons = ReadPhotonPly(options.photons_path);
  if (!photons.ok()) return photons.status();
  Progress progress("upload", photons->size(), "photons");
  UploadOptions upload{
      .time_to_live =
          std::chrono::milliseconds(static_cast<std::int64_t>(options.time_to_live_s * 1000)),
      .request_id = options.request_id,
      .progress = [&progress](std::uint64_t photon_count) { progress.Update(photon_count); }};
  upload.build.set_max_leaf_size(options.max_leaf_size);
  upload.build.set_morton_bits(options.morton_bits);
  const auto built = (*client)->BuildPhotonMap(options.name, *photons, upload);
  progress.End();
  if (!built.ok()) return built.status();
  if (options.json) return PrintJson(*built);
  fmt::print("{}\n{}", FormatMap(built->map()), FormatTimings(built->timings()));
  return absl::OkStatus();
}

}  // namespace

void AddBuildCommand(CLI::App& app, GlobalOptions& global) {
  const auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("build", "Uploads photons from a PLY file and builds a map over them");
  command
      ->add_option("--photons", options->photons_path,
                   "PLY file: x y z [power_red power_green power_blue] "
                   "[dir_u dir_v | nx ny nz]")
      ->required();
  command->add_option("--name", options->name, "Name of the map: A-Z a-z 0-9 . _ -")
      ->required()
      ->check(ServerName());
  command
      ->add_option("--leaf-size", options->max_leaf_size,
                   "Photons in a leaf at most (default: the server's, 16)")
      ->check(CLI::Range(1, 64));
  command
      ->add_option("--morton-bits", options->morton_bits,
                   "Bits of the Morton codes (default: the server's, 30)")
      ->check(CLI::IsMember({30, 63}));
  command
      ->add_option("--ttl", options->time_to_live_s,
                   "Seconds after which the map is deleted (default: never)")
      ->check(NumberIn(0.001, 30.0 * 24 * 3600));
  command
      ->add_option("--request-id", options->request_id,
                   "The same id again answers with the map built first")
      ->check(ServerName());
  command->add_flag("--json", options->json, "As JSON");
  command->callback(
      [options, &global] { global.action = [options, &global] { return Run(*options, global); }; });
}

}  // namespace treelight::client
