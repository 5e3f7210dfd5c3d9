#!/usr/bin/env bash
# Runs examples/python against a server, as its README says: python_example_test.sh TREELIGHTD. Exit code 77: the packages
# that it needs are not installed.
set -euo pipefail
tests=$(cd "$(dirname "$0")" && pwd)
treelightd=${1:?usage: python_example_test.sh TREELIGHTD}
example=$tests/../examples/python
if ! /usr/bin/python3 -c 'import google.protobuf, grpc, numpy'; then
  echo 'SKIPPED: the Python example is not tested; install python3-grpcio and python3-numpy'
  exit 77
fi

stubs=$(mktemp -d)
trap 'rm -rf "$stubs"' EXIT
"$example/generate_stubs.sh" "$stubs"
PYTHONPATH=$stubs PYTHONDONTWRITEBYTECODE=1 "$tests/with_server.sh" "$treelightd" "$example/gather.py"

# An answer that is wrong must not pass: here brute force breaks ties the other way.
sed 's/np.argsort(squared_distances\[ids\], kind="stable")/np.lexsort((-ids, squared_distances[ids]))/' \
  "$example/gather.py" >"$stubs/wrong.py"
if cmp -s "$example/gather.py" "$stubs/wrong.py" ||
  PYTHONPATH=$stubs "$tests/with_server.sh" "$treelightd" /usr/bin/python3 "$stubs/wrong.py" >"$stubs/log" 2>&1; then
  echo 'python_example_test: nothing was changed, or gather.py finds no difference where there is one' >&2
  exit 1
fi
grep -q "the server's answers differ from brute force" "$stubs/log"
