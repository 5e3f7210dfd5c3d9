#ifndef TREELIGHT_SERVER_TOKENS_H_
#define TREELIGHT_SERVER_TOKENS_H_

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"

// Who may call: bearer tokens, of which the server keeps hashes alone. A token is 256 random bits,
// so that a plain SHA-256 gives nothing to guess; salts and slow hashes are for passwords.
namespace treelight::server {

/// One line of a token file: "NAME sha256:HEX".
struct TokenHash {
  std::string name;                        ///< of the client, for the request log
  std::array<unsigned char, 32> sha256{};  ///< of the whole token, "tl_..."
};

/// Reads the lines of a token file; blank lines and those that begin with # are skipped. A name may
/// stand twice, while a token is replaced. INVALID_ARGUMENT names line and cause; `file` begins the
/// message. A file without tokens is one that nobody can call with: it is refused.
absl::StatusOr<std::vector<TokenHash>> ParseTokens(std::string_view text, std::string_view file);

/// A new token, and the line of it for the token file.
struct NewToken {
  std::string token;
  std::string line;  ///< without its end
};

/// From the system's random numbers. INVALID_ARGUMENT: `name` is none (CheckName). INTERNAL: there
/// are no random numbers.
absl::StatusOr<NewToken> MakeToken(std::string_view name);

/// Appends `line` to `file`, which is made with mode 0600 where it is missing, and waits until the
/// disk has it. PERMISSION_DENIED: cannot be written.
absl::Status AppendTokenLine(const std::string& file, const std::string& line);

/// The tokens of a file. Safe to call from several threads at once.
class Tokens {
 public:
  /// NOT_FOUND, PERMISSION_DENIED: `file` cannot be read, or others than its owner and group may
  /// write to it. INVALID_ARGUMENT: ParseTokens.
  static absl::StatusOr<std::unique_ptr<Tokens>> Open(const std::string& file);

  /// Reads the file again. The errors of Open: the tokens stay as they were.
  absl::Status Reload();

  /// The client's name where `token` is one of the file. The time it takes does not depend on what
  /// the file holds of it.
  std::optional<std::string> Find(std::string_view token) const;

  /// The client's name by the value of an `authorization` header, "Bearer TOKEN"; empty view: there
  /// is none. UNAUTHENTICATED says what is missing or wrong, never what was sent.
  absl::StatusOr<std::string> Authenticate(std::string_view authorization) const;

 private:
  using Hashes = std::shared_ptr<const std::vector<TokenHash>>;

  Tokens(std::string file, Hashes hashes) : file_(std::move(file)), hashes_(std::move(hashes)) {}
  Hashes hashes() const;

  const std::string file_;
  mutable std::mutex mutex_;
  Hashes hashes_;  // guarded by mutex_
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_TOKENS_H_
