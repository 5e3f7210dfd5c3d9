#include "tests/emulated/work_group.h"

#include <ucontext.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <csetjmp>
#include <cstdint>
#include <random>
#include <stdexcept>
#include <vector>

namespace treelight::emulated {
namespace {

constexpr std::size_t kItems = 32;  // of a sub-group
constexpr std::size_t kMaxSubGroups = 12;
constexpr std::size_t kStackBytes = std::size_t{128} << 10;
// What an item calls that has ended, or waits for all of the work-group; sub_group.cl has other
// numbers.
constexpr std::uint32_t kEnd = 0, kBarrier = 1;

/// Begun by a context, then switched to by longjmp, which unlike swapcontext makes no system call.
struct Fiber {
  std::vector<char> stack = std::vector<char>(kStackBytes);
  ucontext_t start;
  std::jmp_buf registers;
  bool has_begun;
};

struct SubGroup {
  std::array<std::uint32_t, kItems> values[2];  // of this call and of the one before, by turns
  std::array<std::uint32_t, kItems> functions;
  std::uint32_t calls = 0;
  std::size_t turns = 0;              // items that have had their turn since the last call
  std::size_t stride = 1, shift = 0;  // item of a turn: (turn * stride + shift) % kItems
};

class WorkGroup {
 public:
  void Run(std::size_t groups, std::size_t sub_groups, const std::function<void()>& item);
  const std::uint32_t* Exchange(std::uint32_t function, std::uint32_t value);
  std::size_t group() const { return group_; }
  std::size_t local_id() const { return current_; }
  std::size_t local_size() const { return size_; }
  std::size_t group_count() const { return group_count_; }

 private:
  void RunGroup();
  void NextCall(SubGroup& sub_group);
  void Leave(std::uint32_t function, std::size_t sub_group);
  void SwitchTo(std::size_t item);
  [[noreturn]] void Fail(const char* failure);
  static void RunItem();

  std::size_t group_count_ = 0, size_ = 0, group_ = 0, current_ = 0;
  const std::function<void()>* item_ = nullptr;
  std::vector<std::size_t> running_, waiting_;  // sub-groups, these at a barrier
  const char* failure_ = nullptr;
  std::array<SubGroup, kMaxSubGroups> sub_groups_;
  std::vector<Fiber> fibers_ = std::vector<Fiber>(kMaxSubGroups * kItems);
  std::jmp_buf caller_;
  std::minstd_rand random_;
} work_group;

void WorkGroup::Run(std::size_t groups, std::size_t sub_groups, const std::function<void()>& item) {
  assert(sub_groups <= kMaxSubGroups);
  group_count_ = groups;
  size_ = sub_groups * kItems;
  item_ = &item;
  failure_ = nullptr;
  for (group_ = 0; group_ < groups; ++group_) {
    RunGroup();
    if (failure_ != nullptr) throw std::logic_error(failure_);
  }
}

void WorkGroup::RunGroup() {
  running_.clear();
  waiting_.clear();
  for (std::size_t s = 0; s < size_ / kItems; ++s) {
    running_.push_back(s);
    sub_groups_[s] = SubGroup{};
  }
  for (std::size_t i = 0; i < size_; ++i) {
    Fiber& fiber = fibers_[i];
    fiber.has_begun = false;
    getcontext(&fiber.start);
    fiber.start.uc_stack.ss_sp = fiber.stack.data();
    fiber.start.uc_stack.ss_size = fiber.stack.size();
    makecontext(&fiber.start, RunItem, 0);
  }
  if (_setjmp(caller_) == 0) SwitchTo(0);
}

void WorkGroup::RunItem() {
  (*work_group.item_)();
  work_group.Exchange(kEnd, 0);
}

void WorkGroup::SwitchTo(std::size_t item) {
  current_ = item;
  Fiber& fiber = fibers_[item];
  if (fiber.has_begun) std::longjmp(fiber.registers, 1);
  fiber.has_begun = true;
  setcontext(&fiber.start);
}

void WorkGroup::Fail(const char* failure) {
  failure_ = failure;
  std::longjmp(caller_, 1);
}

/// All items of the sub-group have called.
void WorkGroup::NextCall(SubGroup& sub_group) {
  const auto& functions = sub_group.functions;
  if (std::any_of(functions.begin(), functions.end(),
                  [&](std::uint32_t other) { return other != functions[0]; })) {
    Fail("items of a sub-group have diverged");
  }
  ++sub_group.calls;
  sub_group.turns = 0;
  sub_group.stride = random_() % kItems | 1;
  sub_group.shift = random_() % kItems;
  if (functions[0] <= kBarrier)
    Leave(functions[0], static_cast<std::size_t>(&sub_group - sub_groups_.data()));
}

/// A sub-group has ended, or come to a barrier.
void WorkGroup::Leave(std::uint32_t function, std::size_t sub_group) {
  std::erase(running_, sub_group);
  if (function == kBarrier) waiting_.push_back(sub_group);
  if (!running_.empty()) return;
  if (waiting_.empty()) std::longjmp(caller_, 1);
  if (waiting_.size() * kItems < size_) Fail("sub-groups of a work-group have diverged");
  running_.swap(waiting_);
}

const std::uint32_t* WorkGroup::Exchange(std::uint32_t function, std::uint32_t value) {
  const std::size_t self = current_;
  SubGroup& own = sub_groups_[self / kItems];
  auto& values = own.values[own.calls % 2];
  values[self % kItems] = value;
  own.functions[self % kItems] = function;
  std::size_t next_group = self / kItems;
  if (++own.turns == kItems) {
    NextCall(own);
    next_group = running_[random_() % running_.size()];
  }
  const SubGroup& next = sub_groups_[next_group];
  const std::size_t item = next_group * kItems + (next.turns * next.stride + next.shift) % kItems;
  if (item != self && _setjmp(fibers_[self].registers) == 0) SwitchTo(item);
  return values.data();
}

}  // namespace

// What the kernels call.
extern "C" {
std::size_t emulated_local_id() { return work_group.local_id(); }
std::size_t emulated_group_id() { return work_group.group(); }
std::size_t emulated_local_size() { return work_group.local_size(); }
std::size_t emulated_group_count() { return work_group.group_count(); }
const std::uint32_t* emulated_exchange(std::uint32_t function, std::uint32_t value) {
  return work_group.Exchange(function, value);
}
}

void RunWorkGroups(std::size_t groups, std::size_t sub_groups, const std::function<void()>& item) {
  work_group.Run(groups, sub_groups, item);
}

}  // namespace treelight::emulated
