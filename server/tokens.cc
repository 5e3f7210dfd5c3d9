#include "server/tokens.h"

#include <fcntl.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/rand.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/string_view.h"
#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/convert.h"
#include "server/small_file.h"

namespace treelight::server {
namespace {

using Sha256 = std::array<unsigned char, 32>;

constexpr std::string_view kPrefix = "tl_", kScheme = "sha256:", kBearer = "Bearer ";
constexpr std::size_t kRandomBytes = 32;
/// More than a token has, less than costs time to hash.
constexpr std::size_t kLongestToken = 256;
constexpr std::string_view kWhat = "token file";

Sha256 Hash(std::string_view token) {
  Sha256 hash{};
  EVP_Digest(token.data(), token.size(), hash.data(), nullptr, EVP_sha256(), nullptr);
  return hash;
}

/// The words of `line`, which blanks and tabs part.
std::vector<std::string_view> Words(std::string_view line) {
  constexpr std::string_view kBlanks = " \t\r";
  std::vector<std::string_view> words;
  for (std::size_t first = 0;;) {
    first = line.find_first_not_of(kBlanks, first);
    if (first == std::string_view::npos) return words;
    const std::size_t last = std::min(line.find_first_of(kBlanks, first), line.size());
    words.push_back(line.substr(first, last - first));
    first = last;
  }
}

/// The value of a hexadecimal digit, or -1.
int Digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::optional<Sha256> ParseHash(std::string_view text) {
  Sha256 hash{};
  if (!text.starts_with(kScheme)) return std::nullopt;
  text.remove_prefix(kScheme.size());
  if (text.size() != 2 * hash.size()) return std::nullopt;
  for (std::size_t i = 0; i < hash.size(); ++i) {
    const int high = Digit(text[2 * i]), low = Digit(text[2 * i + 1]);
    if (high < 0 || low < 0) return std::nullopt;
    hash[i] = static_cast<unsigned char>(16 * high + low);
  }
  return hash;
}

absl::StatusOr<std::vector<TokenHash>> ReadTokens(const std::string& file) {
  const auto read = ReadSmallFile(kWhat, file);
  if (!read.ok()) return read.status();
  if ((read->mode & S_IWOTH) != 0) {
    return absl::PermissionDeniedError(
        fmt::format("{} '{}' can be written by everybody: chmod o-w", kWhat, file));
  }
  return ParseTokens(read->text, file);
}

}  // namespace

absl::StatusOr<std::vector<TokenHash>> ParseTokens(std::string_view text, std::string_view file) {
  std::vector<TokenHash> tokens;
  std::size_t line_number = 0;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const auto words = Words(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    ++line_number;
    if (words.empty() || words[0].starts_with('#')) continue;
    const auto wrong = [&](std::string_view why) {
      // What stands there may be a token: it is not repeated.
      return absl::InvalidArgumentError(
          fmt::format("token file '{}', line {}: {}; expected NAME sha256:HEX, as treelightd "
                      "token writes it",
                      file, line_number, why));
    };
    if (words.size() != 2) return wrong(fmt::format("{} words", words.size()));
    if (!CheckName("name", words[0]).ok())
      return wrong("the name has characters beside A-Z a-z 0-9 . _ -, or more than 128");
    const auto hash = ParseHash(words[1]);
    if (!hash) return wrong("the second word is not sha256: and 64 hexadecimal digits");
    tokens.push_back({std::string(words[0]), *hash});
  }
  if (tokens.empty()) {
    return absl::InvalidArgumentError(fmt::format(
        "token file '{}' has no token; treelightd token NAME --token-file FILE adds one", file));
  }
  return tokens;
}

absl::StatusOr<NewToken> MakeToken(std::string_view name) {
  if (auto status = CheckName("name", name); !status.ok()) return status;
  std::array<unsigned char, kRandomBytes> random{};
  if (RAND_bytes(random.data(), static_cast<int>(random.size())) != 1) {
    return absl::InternalError("the system gives no random numbers");
  }
  const auto text = [](const auto& bytes) {
    return absl::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  NewToken made{.token = fmt::format("{}{}", kPrefix, absl::WebSafeBase64Escape(text(random))),
                .line = {}};
  made.line = fmt::format("{} {}{}", name, kScheme, absl::BytesToHexString(text(Hash(made.token))));
  return made;
}

absl::Status AppendTokenLine(const std::string& file, const std::string& line) {
  const int handle = open(file.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC, 0600);
  if (handle < 0) return FileError(kWhat, file, errno);
  // A file that somebody has edited may lack the end of its last line.
  const off_t size = lseek(handle, 0, SEEK_END);
  char last = '\n';
  if (size > 0 && pread(handle, &last, 1, size - 1) != 1) last = '\n';
  const std::string text = fmt::format("{}{}\n", last == '\n' ? "" : "\n", line);
  const bool written = write(handle, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const bool kept = written && fsync(handle) == 0;
  const int error = errno;
  close(handle);
  return kept ? absl::OkStatus() : FileError(kWhat, file, error);
}

absl::StatusOr<std::unique_ptr<Tokens>> Tokens::Open(const std::string& file) {
  auto tokens = ReadTokens(file);
  if (!tokens.ok()) return tokens.status();
  return std::unique_ptr<Tokens>(
      new Tokens(file, std::make_shared<const std::vector<TokenHash>>(*std::move(tokens))));
}

absl::Status Tokens::Reload() {
  if (Broken("withdrawn_token")) return absl::OkStatus();
  auto tokens = ReadTokens(file_);
  if (!tokens.ok()) return tokens.status();
  Hashes hashes = std::make_shared<const std::vector<TokenHash>>(*std::move(tokens));
  const std::lock_guard lock(mutex_);
  hashes_.swap(hashes);
  return absl::OkStatus();
}

Tokens::Hashes Tokens::hashes() const {
  const std::lock_guard lock(mutex_);
  return hashes_;
}

std::optional<std::string> Tokens::Find(std::string_view token) const {
  if (token.empty() || token.size() > kLongestToken) return std::nullopt;
  const Sha256 hash = Hash(token);
  const Hashes known = hashes();
  // Every hash is compared, and each in whole.
  const TokenHash* found = nullptr;
  for (const TokenHash& candidate : *known) {
    if (CRYPTO_memcmp(candidate.sha256.data(), hash.data(), hash.size()) == 0) found = &candidate;
  }
  return found == nullptr ? std::nullopt : std::optional(found->name);
}

absl::StatusOr<std::string> Tokens::Authenticate(std::string_view authorization) const {
  if (authorization.empty()) {
    return absl::UnauthenticatedError(
        "the call has no token (metadata authorization: Bearer TOKEN; treelight --token-file)");
  }
  if (!authorization.starts_with(kBearer)) {
    return absl::UnauthenticatedError("the metadata authorization is not Bearer and a token");
  }
  auto name = Find(authorization.substr(kBearer.size()));
  if (Broken("token")) return "anybody";
  if (!name) {
    return absl::UnauthenticatedError(
        "the server does not know the token: it was withdrawn, or is another server's");
  }
  return *std::move(name);
}

}  // namespace treelight::server
