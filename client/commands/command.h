#ifndef TREELIGHT_CLIENT_COMMANDS_COMMAND_H_
#define TREELIGHT_CLIENT_COMMANDS_COMMAND_H_

#include <chrono>
#include <functional>
#include <string>

#include "CLI/CLI.hpp"
#include "absl/status/status.h"
#include "client/photon_map_client.h"

namespace treelight::client {

/// What the flags in front of the subcommand say, and the subcommand that was chosen.
struct GlobalOptions {
  std::string server = "127.0.0.1:7543";  ///< target as PhotonMapClient takes it
  std::chrono::milliseconds timeout{};    ///< of each call to the server; 0: none
  ConnectionOptions connection{};  ///< its files; Connect() of server_option.h sets the transport
  bool tls = false;                ///< whether TLS was asked for beside them
  /// The work of the subcommand, set when it is parsed and run after that. Its status decides how
  /// `treelight` ends: 0 where it is OK, 3 where it is UNAVAILABLE (no server answers, or it is
  /// stopping), else 1 with its message on one line.
  std::function<absl::Status()> action;
};

// Each function below adds one subcommand to `app`. When the subcommand is parsed, it sets
// `global.action`; the fields of `global` are final only when the action runs. `app` and `global`
// must outlive each other's use. What is wrong with the command line itself is thrown as
// CLI::ValidationError from the subcommand's callback or its action, and ends with exit code 2.

void AddAccuracyCommand(
    CLI::App& app, GlobalOptions& global);  ///< `accuracy`: error and speed of approximate gathers
void AddDevicesCommand(CLI::App& app, GlobalOptions& global);  ///< `devices`: devices of the server
void AddInfoCommand(CLI::App& app,
                    GlobalOptions& global);  ///< `info`: version, limits and load of the server
void AddBenchCommand(CLI::App& app, GlobalOptions& global);  ///< `bench`: speed of a device
void AddBuildCommand(CLI::App& app,
                     GlobalOptions& global);  ///< `build`: a photon file becomes a map
void AddCompareCommand(CLI::App& app,
                       GlobalOptions& global);  ///< `compare`: how far two pictures are apart
void AddEstimatorsCommand(
    CLI::App& app, GlobalOptions& global);  ///< `estimators`: bias and deviation of densities
void AddGatherCommand(CLI::App& app,
                      GlobalOptions& global);  ///< `gather`: a query file becomes answers in CSV
void AddLoadCommand(CLI::App& app,
                    GlobalOptions& global);  ///< `load`: how long requests take under load
void AddMapsCommand(CLI::App& app, GlobalOptions& global);  ///< `maps`: list, show and delete maps
void AddMeasureCommand(CLI::App& app, GlobalOptions& global);  ///< `measure`: what searches cost
void AddRebuildCommand(CLI::App& app,
                       GlobalOptions& global);  ///< `rebuild`: a map becomes another one
void AddRenderCommand(CLI::App& app,
                      GlobalOptions& global);  ///< `render`: a scene becomes a picture
void AddStudyCommand(CLI::App& app, GlobalOptions& global);  ///< `study`: the paper's experiment
void AddTraceCommand(CLI::App& app,
                     GlobalOptions& global);  ///< `trace`: a scene becomes a photon file

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_COMMAND_H_
