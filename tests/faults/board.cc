#include "tests/faults/board.h"

#include "fmt/format.h"

namespace treelight::faults {
namespace {

constexpr std::uint32_t kNameCount = 5;

}  // namespace

std::string NameOf(std::uint32_t number) { return fmt::format("map{}", number % kNameCount); }

void Board::Built(const client::MapRef& map) {
  const std::lock_guard lock(mutex_);
  built_.push_back(map);
}

void Board::Deleted(const client::MapRef& map) {
  const std::lock_guard lock(mutex_);
  std::erase_if(built_, [&](const client::MapRef& built) {
    const bool gone = built.name == map.name && (map.version == 0 || built.version == map.version);
    if (gone) deleted_.push_back(built);
    return gone;
  });
  constexpr std::size_t kRemembered = 64;
  if (deleted_.size() > kRemembered) deleted_.erase(deleted_.begin(), deleted_.end() - kRemembered);
}

client::MapRef Board::AnyBuilt(std::mt19937& random) const {
  const std::lock_guard lock(mutex_);
  return built_.empty() ? client::MapRef{.name = NameOf(random())}
                        : built_[random() % built_.size()];
}

client::MapRef Board::AnyDeleted(std::mt19937& random) const {
  const std::lock_guard lock(mutex_);
  return deleted_.empty() ? client::MapRef{.name = NameOf(random())}
                          : deleted_[random() % deleted_.size()];
}

std::size_t Board::built_count() const {
  const std::lock_guard lock(mutex_);
  return built_.size();
}

}  // namespace treelight::faults
