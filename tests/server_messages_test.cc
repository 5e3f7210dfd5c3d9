#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "tests/gated_builder.h"
#include "tests/open_upload.h"
#include "tests/server_fixture.h"
#include "tests/server_process.h"

// What the program says where something is not as it should be, and that it goes on where it can.
namespace treelight::testing {
namespace {

using ::testing::HasSubstr;

TEST(ServerMessagesTest, TheLeastMemoryIsTold) {
  Process process({"--memory-limit", "1k"});
  EXPECT_EQ(process.Wait(), 2);
  EXPECT_NE(process.err().find("16MiB is the least"), std::string::npos) << process.err();
}

TEST(ServerMessagesTest, AFileThatIsNoSocketIsLeftAlone) {
  Process folder({"--version"});
  const std::string path = folder.folder() + "/file";
  std::ofstream(path) << "mine";
  Process process({"--listen", "unix:" + path});
  EXPECT_EQ(process.Wait(), 1);
  EXPECT_EQ(process.err(), "treelightd: cannot listen on 'unix:" + path +
                               "': what is there is no socket, and is left alone\n");
  EXPECT_TRUE(std::filesystem::exists(path));
  EXPECT_FALSE(std::filesystem::exists(path + ".lock"));
}

TEST(ServerMessagesTest, AFullDiskOfTheLogIsToldOnceAndNobodyWaits) {
  Process folder({"--version"});
  // A limit of the size of files is the smallest disk.
  Process process({"bash", "-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\""},
                  {"--listen", "127.0.0.1:0", "--log-file", folder.folder() + "/log"});
  const std::string address = process.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << process.err();
  const auto stub = Connect(address);
  for (int i = 0; i < 50; ++i) {
    grpc::ClientContext context;
    v1::ServerInfo info;
    ASSERT_TRUE(stub->GetServerInfo(&context, {}, &info).ok());
  }
  const std::string expected = "treelightd: a line of the request log is lost: log file '" +
                               folder.folder() + "/log': File too large\n";
  EXPECT_TRUE(Eventually([&] { return process.err() == expected; })) << process.err();
  process.Signal(SIGTERM);
  EXPECT_EQ(process.Wait(), 0);
  EXPECT_EQ(process.err(), expected);
}

TEST(ServerMessagesTest, ADataFolderThatIsRemovedIsToldAndMapsOnTheDeviceAreServed) {
  Process elsewhere({"--version"});
  const std::string folder = elsewhere.folder() + "/maps";
  Process process({"--listen", "127.0.0.1:0", "--data-dir", folder, "--log-file", "/dev/null"});
  const std::string address = process.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << process.err();
  const auto stub = Connect(address);
  const auto build = [&] {
    v1::BuildPhotonMapResponse built;
    return Build(*stub, MakeUpload("cloud", MakePhotons(100, 1)), built);
  };
  ASSERT_TRUE(build().ok());
  std::filesystem::remove_all(folder);
  const std::string expected = "data folder '" + folder + "' was removed while the server runs";
  for (const bool made_again : {false, true}) {
    if (made_again) std::filesystem::create_directory(folder);
    const grpc::Status refused = build();
    EXPECT_EQ(refused.error_code(), grpc::StatusCode::INTERNAL);
    EXPECT_THAT(refused.error_message(), HasSubstr(expected));
    EXPECT_THAT(process.err(), HasSubstr(expected));
  }
  grpc::ClientContext context;
  v1::GatherResponse answer;
  const auto gathered = stub->Gather(&context, MakeBatch("cloud", {1, 2, 3}, {.k = 1}), &answer);
  EXPECT_TRUE(gathered.ok()) << gathered.error_message();
  EXPECT_EQ(Lines(process.err()), 1u) << process.err();
  EXPECT_TRUE(std::filesystem::is_empty(folder));  // nothing is left of the build
}

}  // namespace
}  // namespace treelight::testing
