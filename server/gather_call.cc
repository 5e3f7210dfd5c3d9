#include "server/gather_call.h"

#include "server/guard.h"

namespace treelight::server {

GatherCall::GatherCall(State& state, grpc::CallbackServerContext& context)
    : state_(state), call_(state, context, "Gather"), batch_(state, call_, AnswerForm::kMessage) {
  Open(state.options.limits.max_message_bytes);
}

void GatherCall::Run(const absl::Status& here) {
  if (!here.ok()) return Ended(here);
  batch_.Run(request(), [this](const absl::Status& status) {
    if (!status.ok()) return Ended(status);
    state_.RunOnCpu(batch_.next_bytes(), [this] { Answer(); });
  });
}

void GatherCall::Answer() {
  Ended(Guard([this] { return batch_.WriteNext(response()); }));
}

void GatherCall::Ended(const absl::Status& status) {
  batch_.Log(status);
  End(call_.End(status));
}

}  // namespace treelight::server
