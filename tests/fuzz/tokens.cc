// The reader of token files.
#include "server/tokens.h"

#include <cstdint>
#include <string_view>

#include "server/convert.h"
#include "tests/fuzz/require.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace treelight;
  const auto tokens = server::ParseTokens({reinterpret_cast<const char*>(data), size}, "file");
  if (!tokens.ok()) {
    fuzz::RequireRefusal(tokens.status());
    return 0;
  }
  fuzz::Require(!tokens->empty(), "a file without tokens is refused");
  for (const server::TokenHash& token : *tokens) {
    fuzz::Require(server::CheckName("name", token.name).ok(), "a token has a name");
  }
  return 0;
}
