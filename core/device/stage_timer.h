#ifndef TREELIGHT_CORE_DEVICE_STAGE_TIMER_H_
#define TREELIGHT_CORE_DEVICE_STAGE_TIMER_H_

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "core/device/opencl.h"
#include "core/gatherer.h"

namespace treelight {

/// Tells how long each stage of the work on an in-order profiling queue took on the device, gaps
/// between launches included, from one marker to the next.
class StageTimer {
 public:
  explicit StageTimer(cl::CommandQueue& queue) : queue_(queue) { Mark(""); }

  /// Ends the stage `name`; does not wait.
  void Mark(std::string name) {
    cl::Event event;
    queue_.enqueueMarkerWithWaitList(nullptr, &event);
    marks_.emplace_back(std::move(name), std::move(event));
  }

  /// Waits for the last stage and returns all of them in order; of those with the same name the
  /// sum.
  std::vector<StageTime> Finish() {
    queue_.finish();
    std::vector<StageTime> stages;
    for (std::size_t i = 1; i < marks_.size(); ++i) {
      const auto begin = marks_[i - 1].second.getProfilingInfo<CL_PROFILING_COMMAND_END>();
      const auto end = marks_[i].second.getProfilingInfo<CL_PROFILING_COMMAND_END>();
      const double us = static_cast<double>(end - begin) * 1e-3;
      const auto known = std::ranges::find(stages, marks_[i].first, &StageTime::stage);
      if (known != stages.end()) {
        known->microseconds += us;
      } else {
        stages.push_back({marks_[i].first, us});
      }
    }
    return stages;
  }

 private:
  cl::CommandQueue& queue_;
  std::vector<std::pair<std::string, cl::Event>> marks_;
};

}  // namespace treelight

#endif  // TREELIGHT_CORE_DEVICE_STAGE_TIMER_H_
