#include "server/gather_call.h"

#include "server/guard.h"

namespace treelight::server {

GatherCall::GatherCall(State& state, grpc::CallbackServerContext& context,
                       const v1::GatherRequest& request, v1::GatherResponse& response)
    : state_(state),
      response_(response),
      call_(state, context, "Gather"),
      batch_(state, call_, AnswerForm::kMessage) {
  batch_.Run(request, [this](const absl::Status& status) {
    if (!status.ok()) return End(status);
    state_.RunOnCpu(batch_.next_bytes(), [this] { Answer(); });
  });
}

void GatherCall::Answer() {
  End(Guard([this] { return batch_.WriteNext(response_); }));
}

void GatherCall::End(const absl::Status& status) {
  batch_.Log(status);
  Finish(call_.End(status));
}

}  // namespace treelight::server
