#ifndef TREELIGHT_SERVER_MEMORY_BUDGET_H_
#define TREELIGHT_SERVER_MEMORY_BUDGET_H_

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string_view>

#include "absl/status/statusor.h"

namespace treelight::server {

/// What host memory is held for.
enum class Holder {
  kUploads,   ///< photons that arrive, until their map is built
  kMessages,  ///< requests of gathers: as they came, parsed, and the one that gRPC has read ahead
  kAnswers,   ///< gathered and not yet taken by the client
  kMaps,      ///< of a device whose memory is the host's
};
inline constexpr std::size_t kHolderCount = 4;

/// "uploads", "messages", "answers", "maps".
std::string_view HolderName(Holder holder);

/// Host memory that the server gives out: nothing is kept for a client that is not counted here
/// first. Safe to call from several threads at once. Counts what was asked for; allocates nothing.
class MemoryBudget {
  struct Books;

 public:
  /// A part of the budget; given back when it goes. May outlive the budget.
  class Share {
   public:
    Share() = default;
    Share(Share&& other) noexcept;
    Share& operator=(Share&& other) noexcept;
    ~Share() { Release(); }

    /// Becomes `bytes` large, without asking: for what has turned out to be of another size than
    /// foreseen.
    void Resize(std::uint64_t bytes);

    /// A share of its own of `bytes`, at most bytes(), which this one loses: for what is asked for
    /// at once and held for two reasons.
    Share Split(Holder holder, std::uint64_t bytes);

    std::uint64_t bytes() const { return bytes_; }

   private:
    friend class MemoryBudget;
    Share(std::shared_ptr<Books> books, Holder holder, std::uint64_t bytes)
        : books_(std::move(books)), holder_(holder), bytes_(bytes) {}
    void Release();

    std::shared_ptr<Books> books_;
    Holder holder_ = Holder::kUploads;
    std::uint64_t bytes_ = 0;
  };

  /// Bytes held, by Holder.
  using Usage = std::array<std::uint64_t, kHolderCount>;

  /// Of `limit_bytes`, `kept_bytes` are for what is not counted here: requests on their way, which
  /// RequestTurns bound.
  explicit MemoryBudget(std::uint64_t limit_bytes, std::uint64_t kept_bytes = 0);

  /// RESOURCE_EXHAUSTED with Quota::kMemory: `bytes` do not fit; `what`, "header.photon_count is 5"
  /// say, begins the message. With `retry_delay` as RetryInfo, unless they would not fit an empty
  /// budget.
  absl::StatusOr<Share> Take(Holder holder, std::uint64_t bytes, std::string_view what,
                             std::chrono::milliseconds retry_delay);

  std::uint64_t limit_bytes() const;
  std::uint64_t room_bytes() const;  ///< of the limit, less what is kept
  std::uint64_t free_bytes() const;  ///< of the room, not taken at present
  Usage usage() const;

 private:
  struct Books {
    const std::uint64_t limit_bytes, kept_bytes;
    std::mutex mutex{};
    Usage usage{};  // guarded by mutex
  };

  const std::shared_ptr<Books> books_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_MEMORY_BUDGET_H_
