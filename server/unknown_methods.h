#ifndef TREELIGHT_SERVER_UNKNOWN_METHODS_H_
#define TREELIGHT_SERVER_UNKNOWN_METHODS_H_

#include "grpcpp/generic/async_generic_service.h"
#include "server/flood_guard.h"

namespace treelight::server {

/// Answers calls of methods that there are not, UNIMPLEMENTED, as gRPC does by itself, and counts
/// them: they too may be opened and reset.
class UnknownMethods final : public grpc::CallbackGenericService {
 public:
  /// `guard` outlives it.
  explicit UnknownMethods(FloodGuard& guard) : guard_(guard) {}

 private:
  class Answer final : public grpc::ServerGenericBidiReactor {
   public:
    Answer(FloodGuard& guard, const grpc::GenericCallbackServerContext& context)
        : presence_(guard, context.peer()) {
      Finish({grpc::StatusCode::UNIMPLEMENTED, "there is no such method here"});
    }
    void OnDone() override { delete this; }

   private:
    FloodGuard::Presence presence_;
  };

  grpc::ServerGenericBidiReactor* CreateReactor(
      grpc::GenericCallbackServerContext* context) override {
    return new Answer(guard_, *context);
  }

  FloodGuard& guard_;
};

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_UNKNOWN_METHODS_H_
