#include "server/read_ahead.h"

#include <atomic>
#include <thread>

#include "gtest/gtest.h"

namespace treelight::server {
namespace {

TEST(ReadAheadTest, OneIsReadWhileAnotherIsTakenUp) {
  ReadAhead<int> messages;
  messages.free() = 1;
  ASSERT_TRUE(messages.Arrived(true));
  ASSERT_TRUE(messages.Take());
  EXPECT_EQ(messages.taken(), 1);
  messages.free() = 2;
  EXPECT_EQ(messages.taken(), 1);
  EXPECT_FALSE(messages.Arrived(true));  // whoever takes up 1 does it next
  ASSERT_TRUE(messages.Next());
  ASSERT_TRUE(messages.Take());
  EXPECT_EQ(messages.taken(), 2);
  EXPECT_FALSE(messages.Next());
  EXPECT_TRUE(messages.Arrived(false));
  EXPECT_FALSE(messages.Take());
}

TEST(ReadAheadTest, WhatArrivesAfterTheEndIsTakenUpByNobody) {
  ReadAhead<int> messages;
  ASSERT_TRUE(messages.Arrived(true));
  ASSERT_TRUE(messages.Take());
  // No Next(): the stream has ended with an error while a read was under way.
  EXPECT_FALSE(messages.Arrived(true));
}

/// A stream of `count` numbers that another thread reads, and the sums that come of it.
class Stream {
 public:
  explicit Stream(int count) : count_(count) {}

  /// Reads and takes up all, on this thread and another one.
  void Run() {
    std::thread reader([this] { Serve(); });
    Serve();
    reader.join();
  }

  int taken_count() const { return taken_count_; }
  bool in_order() const { return in_order_; }
  bool ended() const { return over_; }

 private:
  /// As a thread of gRPC does: waits for a read to be over, and tells.
  void Serve() {
    while (!over_) {
      if (!reading_.exchange(false)) {
        std::this_thread::yield();
        continue;
      }
      const bool ok = sent_ < count_;
      if (ok) messages_.free() = ++sent_;
      if (messages_.Arrived(ok)) TakeUp();
    }
  }

  void TakeUp() {
    do {
      if (!messages_.Take()) {
        over_ = true;
        return;
      }
      const bool ahead = messages_.taken() % 3 != 0;
      if (ahead) reading_ = true;
      in_order_ = in_order_ && messages_.taken() == ++taken_count_;
      if (!ahead) reading_ = true;
    } while (messages_.Next());
  }

  const int count_;
  std::atomic<bool> reading_ = true, over_ = false;
  ReadAhead<int> messages_;
  int sent_ = 0;         // of the one read that is under way
  int taken_count_ = 0;  // of who takes up, as in_order_
  bool in_order_ = true;
};

TEST(ReadAheadTest, TwoThreadsTakeUpEachOnceInOrder) {
  constexpr int kCount = 20000;
  Stream stream(kCount);
  stream.Run();
  EXPECT_TRUE(stream.ended());
  EXPECT_TRUE(stream.in_order());
  EXPECT_EQ(stream.taken_count(), kCount);
}

}  // namespace
}  // namespace treelight::server
