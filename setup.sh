#!/usr/bin/env bash
# Installs the Debian 12 packages that Treelight is built from, those that are missing; setup.sh fuzz: those of the fuzzers
# too; setup.sh nginx: nginx for replicas_test, which Debian starts and enables where an init system runs. Needs root or
# sudo for that, and nothing where all are there.
set -euo pipefail

packages=(
  g++ cmake ninja-build ccache pkg-config
  libgrpc++-dev libssl-dev libprotobuf-dev protobuf-compiler protobuf-compiler-grpc
  libabsl-dev libtbb-dev libembree-dev libopenexr-dev libstb-dev
  ocl-icd-opencl-dev opencl-clhpp-headers pocl-opencl-icd clang-15
  libcli11-dev libspdlog-dev libfmt-dev nlohmann-json3-dev libxxhash-dev prometheus-cpp-dev
  libassimp-dev liblzma-dev
  libgtest-dev libgmock-dev python3-grpcio python3-matplotlib python3-numpy
  dpkg-dev file help2man openssl strace
)
[ "${1:-}" != fuzz ] || packages+=(clang-16 libclang-rt-16-dev)
[ "${1:-}" != nginx ] || packages+=(nginx)

missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing+=("$package")
done
if [ ${#missing[@]} -eq 0 ]; then
  echo "setup: all ${#packages[@]} packages are installed"
  exit 0
fi

echo "setup: installing ${missing[*]}"
as_root=()
if [ "$(id -u)" != 0 ]; then
  command -v sudo >/dev/null || { echo "setup: run as root, or install sudo" >&2; exit 1; }
  as_root=(sudo)
fi
log=$(mktemp)
trap 'rm -f "$log"' EXIT
export DEBIAN_FRONTEND=noninteractive
if ! { "${as_root[@]}" apt-get update -q && "${as_root[@]}" apt-get install -q -y --no-install-recommends "${missing[@]}"; } >"$log" 2>&1; then
  tail -n 20 "$log" >&2
  echo "setup: apt-get failed" >&2
  exit 1
fi
