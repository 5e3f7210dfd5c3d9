#include "server/memory_budget.h"

#include <algorithm>
#include <cassert>
#include <numeric>
#include <optional>
#include <utility>

#include "fmt/format.h"
#include "server/break_switch.h"
#include "server/refusal.h"

namespace treelight::server {
namespace {

std::uint64_t Sum(const MemoryBudget::Usage& usage) {
  return std::accumulate(usage.begin(), usage.end(), std::uint64_t{0});
}

std::uint64_t& Of(MemoryBudget::Usage& usage, Holder holder) {
  return usage[static_cast<std::size_t>(holder)];
}

/// "uploads 5, messages 0, answers 7, maps 0"
std::string Describe(const MemoryBudget::Usage& usage) {
  std::string text;
  for (std::size_t i = 0; i < usage.size(); ++i) {
    fmt::format_to(std::back_inserter(text), "{}{} {}", i == 0 ? "" : ", ",
                   HolderName(static_cast<Holder>(i)), usage[i]);
  }
  return text;
}

}  // namespace

std::string_view HolderName(Holder holder) {
  constexpr std::array<std::string_view, kHolderCount> kNames = {"uploads", "messages", "answers",
                                                                 "maps"};
  return kNames[static_cast<std::size_t>(holder)];
}

MemoryBudget::Share::Share(Share&& other) noexcept
    : books_(std::move(other.books_)),
      holder_(other.holder_),
      bytes_(std::exchange(other.bytes_, 0)) {}

MemoryBudget::Share& MemoryBudget::Share::operator=(Share&& other) noexcept {
  if (this == &other) return *this;
  Release();
  books_ = std::move(other.books_);
  holder_ = other.holder_;
  bytes_ = std::exchange(other.bytes_, 0);
  return *this;
}

void MemoryBudget::Share::Resize(std::uint64_t bytes) {
  if (books_ == nullptr) return;
  const std::lock_guard lock(books_->mutex);
  Of(books_->usage, holder_) += bytes - bytes_;
  bytes_ = bytes;
}

MemoryBudget::Share MemoryBudget::Share::Split(Holder holder, std::uint64_t bytes) {
  assert(books_ != nullptr && bytes <= bytes_);
  const std::lock_guard lock(books_->mutex);
  Of(books_->usage, holder_) -= bytes;
  Of(books_->usage, holder) += bytes;
  bytes_ -= bytes;
  return {books_, holder, bytes};
}

void MemoryBudget::Share::Release() {
  if (!(Broken("memory") && holder_ == Holder::kAnswers)) Resize(0);
  books_.reset();
}

MemoryBudget::MemoryBudget(std::uint64_t limit_bytes, std::uint64_t kept_bytes)
    : books_(std::make_shared<Books>(limit_bytes, kept_bytes)) {
  assert(kept_bytes <= limit_bytes);
}

absl::StatusOr<MemoryBudget::Share> MemoryBudget::Take(Holder holder, std::uint64_t bytes,
                                                       std::string_view what,
                                                       std::chrono::milliseconds retry_delay) {
  const std::lock_guard lock(books_->mutex);
  const std::uint64_t room = room_bytes(), used = Sum(books_->usage);
  if ((used <= room && bytes <= room - used) || Broken("memory_limit")) {
    Of(books_->usage, holder) += bytes;
    return Share(books_, holder, bytes);
  }
  const bool never = bytes > room;
  const std::string kept =
      books_->kept_bytes == 0 ? "" : fmt::format(" and {} kept for requests", books_->kept_bytes);
  return Refuse(Quota::kMemory,
                fmt::format("{}: {} bytes of the server's memory, the limit is {} "
                            "(--memory-limit), of which {} are held ({}){}; {}",
                            what, bytes, limit_bytes(), used, Describe(books_->usage), kept,
                            never ? "ask for less" : "repeat later, or ask for less"),
                never ? std::nullopt : std::optional(retry_delay));
}

std::uint64_t MemoryBudget::limit_bytes() const { return books_->limit_bytes; }

std::uint64_t MemoryBudget::room_bytes() const { return books_->limit_bytes - books_->kept_bytes; }

std::uint64_t MemoryBudget::free_bytes() const {
  return room_bytes() - std::min(room_bytes(), Sum(usage()));
}

MemoryBudget::Usage MemoryBudget::usage() const {
  const std::lock_guard lock(books_->mutex);
  return books_->usage;
}

}  // namespace treelight::server
