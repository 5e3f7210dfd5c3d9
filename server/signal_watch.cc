#include "server/signal_watch.h"

#include <csignal>
#include <cstdlib>
#include <thread>
#include <utility>

#include "server/break_switch.h"

namespace treelight::server {

SignalWatch::SignalWatch(int exit_code) : exit_code_(exit_code) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&signals, signal);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::thread([this, signals] {
    while (true) {
      int signal = 0;
      sigwait(&signals, &signal);
      Take(signal);
    }
  }).detach();
}

void SignalWatch::Take(int signal) {
  const std::lock_guard lock(mutex_);
  if (signal == SIGHUP) {
    if (hang_up_) hang_up_();
    return;
  }
  // Under the lock: nothing is printed as if the process went on.
  if ((!serving_ || signalled_) && !Broken("second_signal")) std::_Exit(exit_code_);
  signalled_ = true;
  wake_.notify_one();
}

void SignalWatch::BeginServing(std::function<void()> hang_up) {
  const std::lock_guard lock(mutex_);
  serving_ = true;
  hang_up_ = std::move(hang_up);
}

void SignalWatch::Wait() {
  std::unique_lock lock(mutex_);
  wake_.wait(lock, [this] { return signalled_; });
}

void SignalWatch::EndServing() {
  const std::lock_guard lock(mutex_);
  hang_up_ = nullptr;
}

}  // namespace treelight::server
