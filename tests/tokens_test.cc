#include "server/tokens.h"

#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "gtest/gtest.h"

namespace treelight::server {
namespace {

/// SHA-256 of "abc", FIPS 180-2, appendix B.1.
constexpr const char* kHashOfAbc =
    "sha256:ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";

std::string TemporaryFile() {
  return std::filesystem::temp_directory_path() / ("treelight_tokens_" + std::to_string(getpid()));
}

TEST(TokensTest, LinesAreNamesAndHashes) {
  const auto tokens = ParseTokens(
      std::string("# all\n\n  alice\t") + kHashOfAbc + " \r\nbob " + kHashOfAbc, "file");
  ASSERT_TRUE(tokens.ok()) << tokens.status();
  ASSERT_EQ(tokens->size(), 2u);
  EXPECT_EQ((*tokens)[0].name, "alice");
  EXPECT_EQ((*tokens)[1].name, "bob");
  EXPECT_EQ((*tokens)[0].sha256[0], 0xba);
  EXPECT_EQ((*tokens)[0].sha256[31], 0xad);
}

TEST(TokensTest, WrongLinesAreNamedAndNeverRepeated) {
  for (const std::string& line : std::initializer_list<std::string>{
           "alice", "alice tl_secret", "alice sha256:ba78", "al/ice " + std::string(kHashOfAbc),
           "alice " + std::string(kHashOfAbc) + " more", "alice " + std::string(kHashOfAbc) + "0",
           "alice sha256:" + std::string(63, 'a') + "g"}) {
    const auto tokens = ParseTokens("# first\n" + line + "\n", "file");
    ASSERT_EQ(tokens.status().code(), absl::StatusCode::kInvalidArgument) << line;
    EXPECT_EQ(tokens.status().message().find("token file 'file', line 2: "), 0u) << tokens.status();
    EXPECT_EQ(tokens.status().message().find("secret"), std::string::npos);
  }
  EXPECT_FALSE(ParseTokens("# nothing\n", "file").ok());
  EXPECT_FALSE(ParseTokens("", "file").ok());
}

TEST(TokensTest, ATokenIsFoundByItsHash) {
  const std::string file = TemporaryFile();
  std::ofstream(file) << "alice " << kHashOfAbc;  // without the end of the line
  const auto made = MakeToken("bob");
  ASSERT_TRUE(made.ok());
  ASSERT_TRUE(AppendTokenLine(file, made->line).ok());
  const auto tokens = Tokens::Open(file);
  std::filesystem::remove(file);
  ASSERT_TRUE(tokens.ok()) << tokens.status();
  EXPECT_EQ((*tokens)->Find("abc"), "alice");
  EXPECT_EQ((*tokens)->Find(made->token), "bob");
  for (const std::string& other : {std::string("abd"), std::string(), made->token + "a",
                                   made->token.substr(1), std::string(10'000, 'a')}) {
    EXPECT_FALSE((*tokens)->Find(other)) << other;
  }
  EXPECT_EQ(*(*tokens)->Authenticate("Bearer abc"), "alice");
  for (const std::string header :
       {"", "abc", "Basic abc", "Bearer  abc", "Bearer ", "Bearer abc "}) {
    EXPECT_EQ((*tokens)->Authenticate(header).status().code(), absl::StatusCode::kUnauthenticated)
        << header;
  }
}

TEST(TokensTest, APipeIsNoTokenFileAndNobodyWaitsForIt) {
  const std::string file = TemporaryFile();
  ASSERT_EQ(mkfifo(file.c_str(), 0600), 0);
  const auto tokens = Tokens::Open(file);
  EXPECT_EQ(tokens.status(),
            absl::PermissionDeniedError("token file '" + file + "' is no regular file"));
  std::filesystem::remove(file);
}

TEST(TokensTest, MadeTokensAreNewAndFullOfRandomBits) {
  std::set<std::string> tokens;
  for (int i = 0; i < 100; ++i) {
    const auto made = MakeToken("alice");
    ASSERT_TRUE(made.ok());
    EXPECT_EQ(made->token.size(), 3u + 43u);  // 256 bits in base64url
    EXPECT_EQ(made->token.find_first_not_of(
                  "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_"),
              std::string::npos);
    tokens.insert(made->token);
    EXPECT_EQ(made->line.find(made->token), std::string::npos);
  }
  EXPECT_EQ(tokens.size(), 100u);
  EXPECT_FALSE(MakeToken("a b").ok());
}

}  // namespace
}  // namespace treelight::server
