#ifndef TREELIGHT_TESTS_FAULTS_GATE_H_
#define TREELIGHT_TESTS_FAULTS_GATE_H_

#include <condition_variable>
#include <mutex>

namespace treelight::faults {

/// Clients that work at once, and can be made to pause.
class Gate {
 public:
  /// Waits while the gate is closed; false once all is over.
  bool Enter();
  void Leave();
  /// Lets nobody in, and waits until nobody is.
  void Close();
  void Open();
  void End();

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  int inside_ = 0;                      // guarded by mutex_
  bool closed_ = false, over_ = false;  // guarded by mutex_
};

}  // namespace treelight::faults

#endif  // TREELIGHT_TESTS_FAULTS_GATE_H_
