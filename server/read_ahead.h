#ifndef TREELIGHT_SERVER_READ_AHEAD_H_
#define TREELIGHT_SERVER_READ_AHEAD_H_

#include <array>
#include <cstddef>
#include <mutex>
#include <optional>
#include <utility>

namespace treelight::server {

/// The messages of a stream, of which one is read while the one before it is taken up: one at a
/// time, in order, each by one thread, which need not be the one that read it. Whoever takes up
/// also starts the reads, one at a time:
///
///   a read is over:  if (messages.Arrived(ok)) TakeUp();
///   TakeUp:          do {
///                      if (!messages.Take()) return End();  // no more come
///                      StartRead(&messages.free());         // or after the next line
///                      Work(messages.taken());
///                    } while (messages.Next());
///
/// A stream that ends leaves the loop without Next(): nobody takes up what arrives later.
template <typename Message>
class ReadAhead {
 public:
  /// A read is over, `ok` where it brought a message. Whether the caller is to take that up; else
  /// whoever takes up does it next. Safe while another thread takes up.
  bool Arrived(bool ok) {
    const std::lock_guard lock(mutex_);
    arrived_ = ok;
    return !std::exchange(taking_, true);
  }

  /// Begins with what has arrived: whether that is a message, taken() from now on.
  bool Take() {
    const std::lock_guard lock(mutex_);
    free_ = 1 - free_;
    return *std::exchange(arrived_, std::nullopt);
  }

  /// That message is done with. Whether the caller is to take up another one, which has arrived.
  bool Next() {
    const std::lock_guard lock(mutex_);
    taking_ = arrived_.has_value();
    return taking_;
  }

  Message& taken() { return messages_[1 - free_]; }  ///< for who takes up
  Message& free() { return messages_[free_]; }  ///< for a read to come, while none is under way

 private:
  std::array<Message, 2> messages_;
  std::size_t free_ = 1;         // index of messages_; of who takes up
  std::mutex mutex_;             // never held when gRPC is called
  bool taking_ = false;          // guarded by mutex_; one that has arrived is taken up
  std::optional<bool> arrived_;  // guarded by mutex_; behind that, a message or the end
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_READ_AHEAD_H_
