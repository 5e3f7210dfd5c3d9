#include <arpa/inet.h>
#include <sys/socket.h>

#include <string>
#include <vector>

#include "server/address.h"
#include "server/file_handle.h"
#include "tests/gated_builder.h"
#include "tests/server_fixture.h"
#include "tests/server_process.h"

// The program beside clients that do nothing but connect.
namespace treelight::testing {
namespace {

using server::FileHandle;

bool Answers(v1::PhotonMapService::Stub& stub) {
  grpc::ClientContext context;
  v1::ServerInfo info;
  return stub.GetServerInfo(&context, {}, &info).ok();
}

TEST(ServerConnectionsTest, MoreConnectionsThanItHasFilesForDoNotEndIt) {
  TemporaryFolder maps;
  Process process({"sh", "-c", "ulimit -n 64; exec \"$@\"", "sh"},
                  {"--listen", "127.0.0.1:0", "--data-dir", maps.path()});
  const std::string address = process.WaitUntilReady();
  ASSERT_FALSE(address.empty()) << process.err();
  const auto stub = Connect(address);
  ASSERT_TRUE(Answers(*stub));
  {
    std::vector<FileHandle> flood;
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(static_cast<std::uint16_t>(server::PortOf(address)));
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    for (int i = 0; i < 200; ++i) {
      flood.emplace_back(socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
      ASSERT_EQ(connect(flood.back().get(), reinterpret_cast<const sockaddr*>(&to), sizeof(to)), 0);
    }
    ASSERT_TRUE(Eventually([&] { return Lines(process.err()) > 0; }));
    // Who is connected is served, with files for maps.
    EXPECT_TRUE(Answers(*stub));
    v1::BuildPhotonMapResponse response;
    const auto built = Build(*stub, MakeUpload("cloud", MakePhotons(100, 1)), response);
    EXPECT_TRUE(built.ok()) << built.error_message();
  }
  // And so are others, once there is room again.
  EXPECT_TRUE(Eventually([&] {
    grpc::ChannelArguments own;
    own.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return Answers(*v1::PhotonMapService::NewStub(
        grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), own)));
  }));
  process.Signal(SIGTERM);
  EXPECT_EQ(process.Wait(), 0);
}

}  // namespace
}  // namespace treelight::testing
