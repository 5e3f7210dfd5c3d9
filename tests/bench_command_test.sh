#!/usr/bin/env bash
# Runs `treelight bench` in small as a user does, in its own program and through a server:
# bench_command_test.sh TREELIGHT TREELIGHTD. Exit code 77: what draws charts is not installed.
set -euo pipefail
tests=$(cd "$(dirname "$0")" && pwd)
treelight=$(realpath "${1:?usage: bench_command_test.sh TREELIGHT TREELIGHTD}")
treelightd=$(realpath "${2:?usage: bench_command_test.sh TREELIGHT TREELIGHTD}")
if [ -z "${TREELIGHT_SERVER:-}" ]; then
  exec "$tests/with_server.sh" "$treelightd" "$tests/bench_command_test.sh" "$treelight" "$treelightd"
fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
fail() {
  echo "bench_command_test: $*" >&2
  exit 1
}
small=(--photons 2000,4000,8000 --detail-photons 4000 --queries 1000 --repetitions 2 --sets W2 --leaf-sizes 16 --k 1,8,50,128
  --no-charts)

native=$("$treelight" devices --local | awk '/ native / {print $1}')

# In this program: every line has as many cells as the first, and every figure its least, middle and largest time.
"$treelight" bench --local --device "$native" "${small[@]}" --threads 1,2 --output local >table.txt 2>log || fail "$(tail -n 1 log)"
head -n 1 local/bench.csv | grep -q '^figure,name,set,seed,fresh,photons,builder,leaf_size,k,radius,' || fail "$(head -n 1 local/bench.csv)"
awk -F, 'NR == 1 { columns = NF; for (i = 1; i <= NF; i++) at[$i] = i; next }
         { if (NF != columns || !($at["device_min_ms"] > 0) || $at["device_min_ms"] > $at["device_median_ms"] ||
               $at["device_median_ms"] > $at["device_max_ms"] || $at["machine"] == "" || $at["device"] == "") exit 1
           seen[$at["figure"]]++ }
         END { exit !(seen["build"] >= 8 && seen["stage"] >= 8 && seen["floor"] == 12 && seen["gather"] > 40) }' \
  local/bench.csv || fail "$(cat local/bench.csv)"
grep -q '^k 50 in r1 ' table.txt || fail "$(cat table.txt)"
grep -q '^W2, seed 1, 8000 photons$' log || fail "$(cat log)"
[ "$(awk -F, '$5 == 1 {print $4}' local/bench.csv | sort -u | wc -l)" = 1 ] || fail 'no fresh seed'

# Through the server: floors are not measured, maps do not stay.
"$treelight" bench "${small[@]}" --fresh-seeds 0 --output remote >table.txt 2>log || fail "$(tail -n 1 log)"
awk -F, '{ seen[$1]++ } END { exit !(seen["build"] == 6 && seen["gather"] > 30 && seen["floor"] == 0) }' remote/bench.csv ||
  fail "$(cut -d, -f1-8 remote/bench.csv)"
"$treelight" maps list | grep -q bench- && fail "$("$treelight" maps list)"
if "$treelight" bench --threads 1,2 --output remote 2>error; then fail 'threads of a server are varied'; fi
grep -q '^treelight: --threads: .* only with --local and the native CPU are they varied$' error || fail "$(cat error)"
if "$treelight" bench --local --device 'none such' --output none 2>error; then fail 'there is such a device'; fi
grep -q '^treelight: device "none such" is none of those here' error || fail "$(cat error)"

# Charts, or one line that says what is missing.
mkdir without
echo 'raise ModuleNotFoundError("no")' >without/matplotlib.py
if PYTHONPATH=without "$treelight" bench --from local/bench.csv --output charts 2>error; then fail 'charts without matplotlib'; fi
grep -q '^treelight: no charts: the charts need matplotlib: apt install python3-matplotlib; the numbers are written$' \
  error || fail "$(cat error)"
if ! /usr/bin/python3 -c 'import matplotlib' 2>/dev/null; then
  echo 'SKIPPED: no charts are drawn; install python3-matplotlib'
  exit 77
fi
"$treelight" bench --from local/bench.csv --output charts
for chart in builds stages gathers_over_k gathers_over_photons threads; do
  file -b "charts/$chart.png" | grep -q '^PNG image' || fail "$chart.png"
  grep -q '<svg' "charts/$chart.svg" || fail "$chart.svg"
done
if "$treelight" bench --from table.txt --output charts 2>error; then fail 'a table is taken for rows'; fi
grep -q '^treelight: no charts: table.txt:1: the columns are not those of a bench: there is no photons$' error || fail "$(cat error)"
sed 's/^gather,k 8,W2,1,0,4000,lbvh,16,8,/gather,k 8,W2,1,0,4000,lbvh,16,eight,/' local/bench.csv >eight.csv
if "$treelight" bench --from eight.csv --output charts 2>error; then fail 'eight is a number'; fi
grep -q "^treelight: no charts: eight.csv:[0-9]*: k is 'eight', no number\$" error || fail "$(cat error)"
