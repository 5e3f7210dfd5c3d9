#ifndef TREELIGHT_SERVER_BUILD_REQUEST_H_
#define TREELIGHT_SERVER_BUILD_REQUEST_H_

#include "absl/status/status.h"
#include "google/protobuf/any.pb.h"

namespace treelight::server {

struct StoredMap;

/// What a build was asked for with: a v1.BuildHeader or a v1.RebuildPhotonMapRequest, kept with its
/// map so that its request id stands for nothing else. Empty: not known.
using BuildRequest = google::protobuf::Any;

/// `request` as it is kept: without fields that this program does not know, some hundred bytes.
BuildRequest KeepRequest(const google::protobuf::Message& request);

/// Whether `request`, from a file perhaps, is one of the two messages.
bool IsBuildRequest(const BuildRequest& request);

/// Whether `repeat`, which has the request id of `first`, asks for what `first` was built for.
/// INVALID_ARGUMENT: it does not; names the first field that differs, both values, and what to do.
/// Of a map whose request is not known the name, the time to live and, where `repeat` tells them,
/// the photons' count and arrays are compared.
absl::Status CheckRepeat(const StoredMap& first, const BuildRequest& repeat);

}  // namespace treelight::server

#endif  // TREELIGHT_SERVER_BUILD_REQUEST_H_
