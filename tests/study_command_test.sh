#!/usr/bin/env bash
# Runs the study in small and the commands that build and judge trees, as a user does:
# study_command_test.sh TREELIGHT TREELIGHTD. Exit code 77: what draws charts is not installed.
set -euo pipefail
tests=$(cd "$(dirname "$0")" && pwd)
treelight=$(realpath "${1:?usage: study_command_test.sh TREELIGHT TREELIGHTD}")
treelightd=$(realpath "${2:?usage: study_command_test.sh TREELIGHT TREELIGHTD}")
if [ -z "${TREELIGHT_SERVER:-}" ]; then
  exec "$tests/with_server.sh" "$treelightd" "$tests/study_command_test.sh" "$treelight" "$treelightd"
fi
unset TREELIGHT_SCENES
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
fail() {
  echo "study_command_test: $*" >&2
  exit 1
}

# A map, other trees from its photons, and what searches cost in them.
"$treelight" trace --scene room --photons 20000 --caustic-photons 0 --output p.ply >/dev/null 2>&1
"$treelight" build --photons p.ply --name room --leaf-size 8 >build.txt 2>/dev/null
grep -q '^options  *lbvh, 30 Morton bits, at most 8 photons in a leaf$' build.txt || fail "$(cat build.txt)"
"$treelight" rebuild --map room --builder treelet --leaf-size 8 >rebuild.txt
grep -Eq '^map  *room@2$' rebuild.txt || fail "$(cat rebuild.txt)"
grep -Eq '^options  *treelet by isa with the leaf term, treelets of 7 leaves, 3 rounds, radius [0-9.]+, 30 Morton bits, ' \
  rebuild.txt || fail "$(cat rebuild.txt)"
"$treelight" rebuild --map room@1 --name swept --builder isa --leaf-size 8 --ttl 100 --json |
  grep -q '"builder": "BUILDER_KIND_SWEEP"' || fail 'no sweep'
nodes() { "$treelight" measure --map "$1" --queries p.ply | awk '/^the 50 nearest/ {print $4}'; }
lbvh=$(nodes room@1) treelets=$(nodes room) swept=$(nodes swept)
awk -v a="$lbvh" -v b="$treelets" -v c="$swept" 'BEGIN {exit !(b < 0.92 * a && c < 0.86 * a && c > 0)}' ||
  fail "nodes of lbvh $lbvh, treelet $treelets, isa $swept"
if "$treelight" rebuild --map room --builder isa --heuristic sah 2>error; then fail 'two heuristics are taken'; fi
grep -q -- '--builder isa is a sweep by isa' error || fail "$(cat error)"

# The study in small.
"$treelight" study --quick --output small --no-charts >tables.txt 2>log || fail "$(tail -n 1 log)"
grep -q 'the built-in scene room stands in for conference' log || fail 'the stand-in is not told'
grep -q 'huge: refused: ' log || fail 'the refusal is not told'
head -n 1 small/study.csv | grep -q '^scene,set,seed,photons,builder,heuristic,treelet_size,rounds,leaf_size,sah_cost,' ||
  fail "$(head -n 1 small/study.csv)"
[ "$(grep -c ',karras,' small/study.csv)" -ge 20 ] || fail 'few rows of the baseline'
# Treelets by isa with the leaf term visit fewer nodes than the baseline over the same photons, for every seed.
awk -F, '$1 == "room" && $2 == "light" && $9 == 8 {
           if ($5 == "karras") base[$3] = $15
           if ($5 == "treelet" && $6 == "isa" && $8 == 3 && $21 == "leaf_size") treelet[$3] = $15 }
         END { for (seed in base) { seeds++; if (!(treelet[seed] > 0 && treelet[seed] < 0.93 * base[seed])) exit 1 }
               exit seeds != 2 }' small/study.csv || fail 'treelets are no better than the baseline'
"$treelight" study --from small/study.csv --output again --no-charts >again.txt
cmp -s small/summary.csv again/summary.csv || fail 'the same rows have another summary'
if "$treelight" study --from p.ply --output again 2>error; then fail 'a PLY file is taken for rows'; fi
grep -q '^treelight: p.ply:1: the columns are not those of a study' error || fail "$(cat error)"
# What --quick and --from would leave unread is refused by name.
if "$treelight" study --quick --tree isa --output again 2>error; then fail '--quick takes --tree'; fi
grep -q -- '--tree' error || fail "$(cat error)"
if "$treelight" study --from small/study.csv --seeds 3 --output again 2>error; then fail '--from takes --seeds'; fi
grep -q -- '--seeds' error || fail "$(cat error)"

# Charts, or one line that says what is missing.
mkdir without
echo 'raise ModuleNotFoundError("no")' >without/matplotlib.py
if PYTHONPATH=without "$treelight" study --from small/study.csv --output again >/dev/null 2>error; then
  fail 'charts without matplotlib'
fi
grep -q '^treelight: no charts: the charts need matplotlib: apt install python3-matplotlib; the numbers are written$' \
  error || fail "$(cat error)"
if ! /usr/bin/python3 -c 'import matplotlib' 2>/dev/null; then
  echo 'SKIPPED: no charts are drawn; install python3-matplotlib'
  exit 77
fi
"$treelight" study --from small/study.csv --output again >/dev/null
for chart in table1 leaf_sizes build_times; do
  file -b "again/$chart.png" | grep -q '^PNG image' || fail "$chart.png"
  grep -q '<svg' "again/$chart.svg" || fail "$chart.svg"
done
