#include "tests/server_process.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <list>
#include <sstream>
#include <thread>

#include "nlohmann/json.hpp"
#include "server/unix_socket.h"
#include "tests/gated_builder.h"
#include "tests/open_upload.h"
#include "tests/server_fixture.h"

// The program itself: what it says and does as a process.
namespace treelight::testing {
namespace {

TEST(ServerProcessTest, AWrongCommandLineIsOneLineAndExitCode2) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"--nosuch"},
                                                    {"--listen", "7543"},
                                                    {"--listen", "0.0.0.0:0"},
                                                    {"--queue-depth", "0"},
                                                    {"--max-photons", "many"},
                                                    {"--config", "/nosuch"},
                                                    {"--build-slots", "0"},
                                                    {"--memory-limit", "much"},
                                                    {"--memory-limit", "-5"},
                                                    {"--memory-limit", "1k"},
                                                    {"--memory-limit", "15MiB"},
                                                    {"healthcheck", "--tls-cert", "server.pem"},
                                                    {"--max-connections", "0"},
                                                    {"--stall-seconds", "0"},
                                                    {"--slow-ms", "-1"},
                                                    {"--drain-delay", "-1"},
                                                    {"--metrics-listen", "9464"},
                                                    {"--metrics-listen", "0.0.0.0:0"},
                                                    {"--metrics-listen", "unix:/tmp/m"},
                                                    {"nosuch"},
                                                    {"--drain-seconds", "nan"},
                                                    {"--drain-seconds", "-1"},
                                                    {"--data-dir", ""},
                                                    {"--device", "nosuch"}}) {
    Process process(arguments);
    EXPECT_EQ(process.Wait(), 2) << arguments[0];
    EXPECT_EQ(Lines(process.err()), 1u) << process.err();
    EXPECT_EQ(process.err().find("treelightd: "), 0u) << process.err();
    EXPECT_EQ(process.out(), "");
  }
}

TEST(ServerProcessTest, AWrongConfigurationFileIsNamed) {
  const std::string garbage("\0\1\xff garbage\n\x80[[[\nfoo\n", 21);
  for (const std::string& text : {garbage, std::string("nosuch=3\n")}) {
    Process folder({"--version"});
    const std::string config = folder.folder() + "/config";
    std::ofstream(config) << text;
    Process process({"--config", config});
    EXPECT_EQ(process.Wait(), 2);
    const std::string expected =
        "treelightd: file '" + config + "' of --config: no option is named";
    EXPECT_EQ(process.err().substr(0, expected.size()), expected) << process.err();
    EXPECT_EQ(Lines(process.err()), 1u) << process.err();
  }
}

TEST(ServerProcessTest, AQuoteThatIsNotClosedIsNamed) {
  Process folder({"--version"});
  const std::string config = folder.folder() + "/config";
  std::ofstream(config) << "max-calls=5\ndata-dir=\"maps\n";
  Process process({"--config", config});
  EXPECT_EQ(process.Wait(), 2);
  EXPECT_EQ(process.err(), "treelightd: file '" + config +
                               "' of --config: the quote of data-dir=\"maps is not closed\n");
}

TEST(ServerProcessTest, AWrongVariableOfTheEnvironmentIsNamed) {
  setenv("TREELIGHT_MAX_CALLS", "abc", 1);
  Process variable({}), option({"--max-calls=abcd"});
  unsetenv("TREELIGHT_MAX_CALLS");
  EXPECT_EQ(variable.Wait(), 2);
  EXPECT_EQ(variable.err().find("treelightd: TREELIGHT_MAX_CALLS: --max-calls: 'abc' is no"), 0u)
      << variable.err();
  EXPECT_EQ(option.Wait(), 2);
  EXPECT_EQ(option.err().find("treelightd: --max-calls: 'abcd' is no"), 0u) << option.err();
}

/// The index of the first device that has kernels to compile.
int OpenClDevice() {
  for (const DeviceInfo& device : ListDevices()) {
    if (device.platform != kNativePlatform) return device.index;
  }
  ADD_FAILURE() << "install pocl-opencl-icd";
  return 0;
}

TEST(ServerProcessTest, ASignalWhileKernelsCompileEndsItAtOnce) {
  Process folder({"--version"});
  // A cold start: no kernel of an earlier one is found.
  setenv("POCL_CACHE_DIR", (folder.folder() + "/pocl").c_str(), 1);
  const std::string kernels = folder.folder() + "/kernels";
  Process process({"--listen", "127.0.0.1:0", "--cache-dir", kernels, "--device",
                   std::to_string(OpenClDevice())});
  unsetenv("POCL_CACHE_DIR");
  ASSERT_TRUE(Eventually([&] { return std::filesystem::exists(kernels); })) << process.err();
  process.Signal(SIGTERM);
  const auto signalled = std::chrono::steady_clock::now();
  EXPECT_EQ(process.Wait(), 130);
  EXPECT_LT(std::chrono::steady_clock::now() - signalled, std::chrono::seconds(1));
  EXPECT_EQ(process.out(), "");
}

TEST(ServerProcessTest, VersionIsPrinted) {
  Process process({"--version"});
  EXPECT_EQ(process.Wait(), 0);
  EXPECT_EQ(process.out(), "treelightd 0.1.0\n");
}

TEST(ServerProcessTest, ServesLogsAndDrainsWhileACallIsOpen) {
  Process process({"--listen", "127.0.0.1:0", "--drain-seconds", "30"});
  const std::string address = process.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << process.out() << process.err();
  EXPECT_EQ(Lines(process.out()), 1u);
  const auto stub = Connect(address);
  const Photons photons = MakePhotons(2357, 1);
  const auto messages = MakeUpload("cloud", photons);

  // An upload that stands still is an open call.
  grpc::ClientContext context;
  v1::BuildPhotonMapResponse built;
  const auto writer = stub->BuildPhotonMap(&context, &built);
  ASSERT_TRUE(writer->Write(messages[0]));
  v1::ServerInfo info;
  {
    grpc::ClientContext info_context;
    ASSERT_TRUE(stub->GetServerInfo(&info_context, {}, &info).ok());
    EXPECT_EQ(info.version(), "0.1.0");
    EXPECT_GT(info.devices_size(), info.device_index());
  }
  process.Signal(SIGTERM);
  EXPECT_TRUE(Eventually([&] {
    grpc::ClientContext late;
    return stub->GetServerInfo(&late, {}, &info).error_code() == grpc::StatusCode::UNAVAILABLE;
  }));
  for (std::size_t i = 1; i < messages.size(); ++i) ASSERT_TRUE(writer->Write(messages[i]));
  writer->WritesDone();
  const auto status = writer->Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(built.map().photon_count(), 2357u);
  EXPECT_EQ(process.Wait(), 0);

  // Every line of the log is JSON; the build's has what the answer has.
  std::istringstream lines(process.err());
  nlohmann::json build;
  for (std::string line; std::getline(lines, line);) {
    const auto json = nlohmann::json::parse(line);
    if (json["method"] == "BuildPhotonMap") build = json;
  }
  for (const char* field :
       {"time", "request_id", "peer", "bytes_in", "bytes_out", "receive_us", "queue_us",
        "upload_us", "kernel_us", "download_us", "serialise_us", "total_us"}) {
    EXPECT_TRUE(build.contains(field)) << field;
  }
  EXPECT_EQ(build["map"], "cloud");
  EXPECT_EQ(build["photons"], 2357);
  EXPECT_EQ(build["code"], "OK");
  EXPECT_EQ(build["device"], built.map().device());
  EXPECT_EQ(build["stages_us"].size(), static_cast<std::size_t>(built.map().build_stages_size()));
  EXPECT_GT(build["stages_us"].size(), 0u);
}

/// The index of the first device of a CPU that has OpenCL; -1 where there is none.
int OpenClCpu() {
  for (const DeviceInfo& device : ListDevices()) {
    if (device.type == "cpu" && device.platform != kNativePlatform) return device.index;
  }
  return -1;
}

TEST(ServerProcessTest, ServesOnTheOpenClOfACpuThatDeviceNames) {
  const int device = OpenClCpu();
  if (device < 0) GTEST_SKIP() << "no CPU has OpenCL here";
  Process process({"--listen", "127.0.0.1:0", "--device", std::to_string(device)});
  const std::string address = process.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << process.err();
  const auto stub = Connect(address);
  v1::ServerInfo info;
  {
    grpc::ClientContext context;
    ASSERT_TRUE(stub->GetServerInfo(&context, {}, &info).ok());
    EXPECT_EQ(info.device_index(), static_cast<std::uint32_t>(device));
  }
  const Photons photons = MakePhotons(2003, 1);
  v1::BuildPhotonMapResponse built;
  const auto status = Build(*stub, MakeUpload("cloud", photons), built);
  ASSERT_TRUE(status.ok()) << status.error_message();
  EXPECT_EQ(built.map().device(), info.devices(device).name());

  const auto queries = MakePoints(50, 2);
  const GatherOptions options{.k = 7, .radius = 0.2f, .outputs = kOutputCount | kOutputNeighbors};
  v1::GatherResponse answer;
  {
    grpc::ClientContext context;
    const auto gathered = stub->Gather(&context, MakeBatch("cloud", queries, options), &answer);
    ASSERT_TRUE(gathered.ok()) << gathered.error_message();
  }
  const auto brute_force = MakeBruteForceBuilder()->Build(photons, {});
  const GatherResult expected = *(*brute_force)->Gather({.positions = queries}, options);
  EXPECT_EQ(Array<std::uint32_t>(answer.counts()), expected.counts);
  EXPECT_EQ(Array<std::uint32_t>(answer.neighbor_ids()), expected.neighbor_ids);
  EXPECT_EQ(Array<float>(answer.neighbor_squared_distances()), expected.neighbor_squared_distances);
  {
    grpc::ClientContext context;
    v1::DeletePhotonMapRequest request;
    request.set_name("cloud");
    v1::DeletePhotonMapResponse response;
    EXPECT_TRUE(stub->DeletePhotonMap(&context, request, &response).ok());
  }
  process.Signal(SIGTERM);
  EXPECT_EQ(process.Wait(), 0);
}

TEST(ServerProcessTest, ASecondSignalEndsItAtOnce) {
  Process process({"--listen", "127.0.0.1:0"});
  const auto stub = Connect(process.WaitUntilReady());
  OpenUpload upload(*stub, MakeUpload("cloud", MakePhotons(10, 1))[0]);
  process.Signal(SIGTERM);
  EXPECT_TRUE(Eventually([&] {
    v1::ServerInfo info;
    grpc::ClientContext late;
    return stub->GetServerInfo(&late, {}, &info).error_code() == grpc::StatusCode::UNAVAILABLE;
  }));
  process.Signal(SIGINT);
  EXPECT_EQ(process.Wait(), 130);
  EXPECT_FALSE(upload.Finish().ok());
}

TEST(ServerProcessTest, AnAddressThatIsTakenIsOneLineAndExitCode1) {
  Process first({"--listen", "127.0.0.1:0"});
  const std::string address = first.WaitUntilReady();
  Process second({"--listen", address});
  EXPECT_EQ(second.Wait(), 1);
  EXPECT_EQ(second.err(),
            "treelightd: cannot listen on '" + address + "': Address already in use\n");
}

TEST(ServerProcessTest, ALogThatCannotBeWrittenIsOneLineAndExitCode1) {
  for (const std::string file : {"/dev/full", "/nosuch/log", "/tmp"}) {
    Process process({"--listen", "127.0.0.1:0", "--log-file", file});
    EXPECT_EQ(process.Wait(), 1);
    EXPECT_EQ(process.err().find("treelightd: log file '" + file + "': "), 0u) << process.err();
    EXPECT_EQ(Lines(process.err()), 1u) << process.err();
    EXPECT_EQ(process.out(), "");
  }
}

TEST(ServerProcessTest, AUnixSocketThatAnswersIsNotTaken) {
  Process first({"--listen", "127.0.0.1:0"});  // only for its folder
  const std::string address = "unix:" + first.folder() + "/socket";
  v1::ServerInfo info;
  {
    Process owner({"--listen", address});
    ASSERT_EQ(owner.WaitUntilReady(), address) << owner.err();
    Process thief({"--listen", address});
    EXPECT_EQ(thief.Wait(), 1);
    EXPECT_EQ(thief.err(), "treelightd: cannot listen on '" + address +
                               "': another process holds '" + first.folder() + "/socket.lock'\n");
    grpc::ClientContext context;
    EXPECT_TRUE(Connect(address)->GetServerInfo(&context, {}, &info).ok());
  }
  // The owner was killed: its file is left, and nobody answers.
  ASSERT_TRUE(std::filesystem::exists(first.folder() + "/socket"));
  Process heir({"--listen", address});
  EXPECT_EQ(heir.WaitUntilReady(), address) << heir.err();
  grpc::ClientContext context;
  EXPECT_TRUE(Connect(address)->GetServerInfo(&context, {}, &info).ok());
}

TEST(ServerProcessTest, OfServersThatStartAtOnceOnOneUnixSocketOneServes) {
  Process folder({"--version"});
  const std::string path = folder.folder() + "/socket", address = "unix:" + path;
  std::list<Process> processes;
  for (int i = 0; i < 4; ++i) processes.emplace_back(std::vector<std::string>{"--listen", address});
  std::vector<const Process*> serving;
  for (Process& process : processes) {
    if (process.WaitUntilReadyOrEnded() == address) {
      serving.push_back(&process);
    } else {
      EXPECT_EQ(process.err(), "treelightd: cannot listen on '" + address +
                                   "': another process holds '" + path + ".lock'\n");
    }
  }
  ASSERT_EQ(serving.size(), 1u);
  v1::ServerInfo info;
  grpc::ClientContext context;
  EXPECT_TRUE(Connect(address)->GetServerInfo(&context, {}, &info).ok());
}

TEST(UnixSocketTest, OneThreadOfManyGetsTheLock) {
  Process folder({"--version"});
  const std::string address = "unix:" + folder.folder() + "/socket";
  for (int round = 0; round < 20; ++round) {
    std::atomic<int> taken = 0;
    std::vector<absl::StatusOr<server::SocketLock>> locks;
    for (int t = 0; t < 4; ++t) locks.push_back(absl::UnknownError("not tried"));
    {
      std::vector<std::jthread> threads;
      for (auto& lock : locks) {
        threads.emplace_back([&] {
          lock = server::SocketLock::Take(address);
          taken += lock.ok() ? 1 : 0;
        });
      }
    }
    EXPECT_EQ(taken, 1);
  }
}

TEST(UnixSocketTest, ASocketThatAnswersWithoutALockIsNotTaken) {
  Process folder({"--version"});
  sockaddr_un name{.sun_family = AF_UNIX, .sun_path = {}};
  const std::string path = folder.folder() + "/socket";
  std::ranges::copy(path, name.sun_path);
  const int socket = ::socket(AF_UNIX, SOCK_STREAM, 0);
  ASSERT_EQ(bind(socket, reinterpret_cast<const sockaddr*>(&name), sizeof(name)), 0);
  ASSERT_EQ(listen(socket, 1), 0);
  const auto lock = server::SocketLock::Take("unix:" + path);
  close(socket);
  EXPECT_EQ(lock.status(), absl::UnavailableError("cannot listen on 'unix:" + path +
                                                  "': another process answers there"));
}

TEST(ServerProcessTest, TheCommandLineGoesBeforeTheFileBeforeTheEnvironment) {
  Process first({"--listen", "127.0.0.1:0"});  // only for its folder
  const std::string config = first.folder() + "/config";
  std::ofstream(config) << "max-photons=222\nmax-queries=222\n";
  setenv("TREELIGHT_MAX_PHOTONS", "111", 1);
  setenv("TREELIGHT_MAX_QUERIES", "111", 1);
  setenv("TREELIGHT_MAX_NEIGHBORS", "111", 1);
  Process process({"--listen", "127.0.0.1:0", "--config", config, "--max-photons", "333"});
  for (const char* name :
       {"TREELIGHT_MAX_PHOTONS", "TREELIGHT_MAX_QUERIES", "TREELIGHT_MAX_NEIGHBORS"}) {
    unsetenv(name);
  }
  v1::ServerInfo info;
  grpc::ClientContext context;
  ASSERT_TRUE(Connect(process.WaitUntilReady())->GetServerInfo(&context, {}, &info).ok());
  EXPECT_EQ(info.limits().max_photons(), 333u);
  EXPECT_EQ(info.limits().max_queries(), 222u);
  EXPECT_EQ(info.limits().max_neighbors(), 111u);
}

}  // namespace
}  // namespace treelight::testing
