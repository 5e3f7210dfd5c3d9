#!/usr/bin/env bash
# Makes the Python messages and stubs of photon_map.proto: generate_stubs.sh FOLDER [PROTO_FOLDER]. They are imported as
# treelight.v1.photon_map_pb2 and treelight.v1.photon_map_pb2_grpc where FOLDER is in PYTHONPATH.
# Needs Debian's protobuf-compiler and protobuf-compiler-grpc.
set -euo pipefail
folder=${1:?usage: generate_stubs.sh FOLDER [PROTO_FOLDER]}
proto=${2:-$(dirname "$0")/../../proto}
[ -d "$proto" ] || proto=/usr/share/treelight/proto  # where libtreelight-dev has it
plugin=$(command -v grpc_python_plugin) || { echo 'generate_stubs: install protobuf-compiler-grpc' >&2; exit 1; }
mkdir -p "$folder"
protoc -I "$proto" --python_out="$folder" --grpc_out="$folder" \
  --plugin=protoc-gen-grpc="$plugin" treelight/v1/photon_map.proto
