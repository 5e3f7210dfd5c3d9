#!/usr/bin/env bash
# Plants one mutation in each stage of the core and expects the test of that stage to fail: a test that cannot is no test.
# Works on a copy under build-mutations. Prints a line for each; exits 1 where a mutation survives.
set -euo pipefail
cd "$(dirname "$0")/.."

# FILE of core/kernels @ sed expression @ test that must fail
mutations='
bounds.cl         @ s/half_size > 0; half_size/half_size > 1; half_size/ @ bounds_test
bounds.cl         @ s/0x1p21f/0x1p20f/ @ bounds_test
morton.cl         @ s/0x030c30c3u/0x030c30c2u/ @ morton_test
morton.cl         @ s/0x10c30c30c30c30c3ul/0x10c30c30c30c30c2ul/ @ morton_test
scan.cl           @ s/return sum - value;/return sum;/ @ scan_test
radix_sort.cl     @ s/shared, shift + 4)/shared, shift)/ @ radix_sort_test
query_order.cl    @ s/ : -2);/ : 0);/ @ query_order_test
query_order.cl    @ s/<= near_cells/< 1024u/ @ query_order_test
split_levels.cl   @ s/clz(difference) - 2/clz(difference) - 1/ @ split_levels_test
ties.cl           @ s/127 + 9 - exponent/127 + 8 - exponent/ @ ties_test
ties.cl           @ s/(leaf_count + 1) \/ 2/leaf_count \/ 2/ @ ties_test
ties.cl           @ s/clz(i ^ (i + 1))/clz(i)/ @ ties_test
large_subtree.cl  @ s/b - a + 1 > cap/b - a > cap/ @ leaves_test
leaves.cl         @ s/counts\[group\] + popcount/popcount/ @ leaves_test
hierarchy.cl      @ s/count += sibling_count/count += 1/ @ hierarchy_test
hierarchy.cl      @ s/min_id = min(min_id, min_ids\[/min_id = max(min_id, min_ids[/ @ hierarchy_test
statistics.cl     @ s/node->right_max/node->left_max/ @ hierarchy_test
sweep.cl          @ s/run.last > run.end) {/run.last > run.end + 8) {/ @ gpu_sweep_test
subtree.cl        @ s/u == v \&\& a > b/u == v \&\& a < b/ @ gpu_sweep_test
sweep.cl          @ s/kLevelSweep + depth/kLevelSweep/ @ gpu_sweep_test
measure.cl        @ s/d.z \* d.x/d.z * d.y/ @ gpu_sweep_test
treelet_search.cl @ s/(other_high < low ? 0u/(other_high <= low ? 0u/ @ tree_kinds_test
treelet_search.cl @ s/return is_apart ? apart_left : touching_left;/return touching_left;/ @ tree_kinds_test
treelet_round.cl  @ s/(treelet, i, nodes, costs/(treelet, 0, nodes, costs/ @ tree_kinds_test
photon_powers.cl  @ s/vload3(i, powers)/vload3(i \/ 2, powers)/ @ gatherer_test
heap.cl           @ s/heap\[(child + 1) \* stride\] > largest/heap[(child + 1) * stride] < largest/ @ gatherer_test
traverse.cl       @ s/normal.z < 0/normal.z > 0/ @ gatherer_test
traverse.cl       @ s/return fmax(2.0f/return fmax(1.99f/ @ gatherer_test
traverse.cl       @ s/value - sum->lost/value/ @ gatherer_test
traverse.cl       @ s/fmax(q - low, high - q)/fmax(low - q, q - high)/ @ gatherer_test
gather_nearest.cl @ s/bits < limit ||/bits < limit \&\& false ||/ @ gatherer_test
gather_nearest.cl @ s/ || (bits == limit \&\& \*min_id < (uint)worst)// @ gatherer_test
gather_nearest.cl @ s/(uint)worst);$/0xffffffffu);/ @ gatherer_test
gather_nearest.cl @ s/d2 \* given_up->squared_stretch/2 * d2 * given_up->squared_stretch/ @ approximate_nearest_test
gather_nearest.cl @ s/if (--leaves_left == 0)/if (--leaves_left == 1)/ @ approximate_nearest_test
gather_sums.cl    @ s/2 \* unit \* first/unit * first/ @ approximate_density_test
gather_sums.cl    @ s/8 \* sum/9 * sum/ @ approximate_density_test
../model/first_beyond.cc @ s/<= limit/< limit/ @ first_beyond_test
../model/power_moments.cc @ s/square += other.square +/square +=/ @ approximate_density_test
../cpu/simd/packed_search_impl.h @ s/near ^= left_out;/near \&= ~left_out << 1;/ @ approximate_nearest_test
gather_wide.cl    @ s/\&\& d2 <= worst\[j\];/\&\& d2 < worst[j];/ @ emulated_wide_test
gather_wide.cl    @ s/as_uint(low.w) <= worst_ids/as_uint(low.w) > worst_ids/ @ emulated_wide_test
gather_wide.cl    @ s/length < params.k \&\& worst/length < 1 \&\& worst/ @ emulated_wide_test
gather_long.cl    @ s/size <= list_size - SUB_GROUP_SIZE/size <= list_size/ @ emulated_wide_test
gather_long.cl    @ s/size >= params.k || reach == limit/size > 0 || reach == limit/ @ emulated_wide_test
long_list.cl      @ s/rank += list\[bins.members\[i\]\] < value/rank += list[bins.members[i]] <= value/ @ emulated_wide_test
long_list.cl      @ s/list\[first\] = b;/list[first] = a;/ @ emulated_wide_test
candidate_list.cl @ s/candidate.y <= bound_id/candidate.y >= bound_id/ @ emulated_wide_test
candidate_list.cl @ s/if (runs != 0)/if (runs == 1)/ @ emulated_wide_test
count_wide.cl     @ s/whole \&= far_squared_distance/whole |= far_squared_distance/ @ emulated_wide_test
density_wide.cl   @ s/d2\[j\] = NAN/d2[j] = 0/ @ emulated_wide_test
wide_walk.cl      @ s/^  sub_group_sync();// @ emulated_wide_test
radix_sort_onesweep.cl @ s/before + sum - value/before + sum/ @ emulated_radix_sort_test
radix_sort_onesweep.cl @ s/^    sub_group_sync();// @ emulated_radix_sort_test
ties_short.cl     @ s/min(max_leaf_size, (uint)TIE_SHORT_RUN)/max_leaf_size/ @ emulated_ties_test
ties_short.cl     @ s/(a > b) == /(a < b) == / @ emulated_ties_test
wide_tree.cl      @ s/popcount(before) > max_begins/popcount(before) > 31/ @ emulated_wide_tree_test
wide_tree.cl      @ s/tile_end + ctz(after)/tile_end/ @ emulated_wide_tree_test
sub_group.cl      @ s/(lane \& 2) != 0/(lane \& 4) != 0/ @ emulated_wide_test
gather_range.cl   @ s/if (d2 > r2) continue/if (d2 >= r2) continue/ @ gatherer_test
gather_list.cl    @ s/if (d2 <= r2) sift_up/if (d2 < r2) sift_up/ @ gatherer_test
../cpu/batch_gather.cc @ s/(1 + 1e-5)/(1 - 1e-2)/ @ packed_search_test
../cpu/simd/packed_search_impl.h @ s/L::LessEqual(d2, L::All(candidates.limit()))/L::Less(d2, L::All(candidates.limit()))/ @ packed_search_test
../cpu/simd/candidates.h @ s/ids\[j\] < ids\[i\]/ids[j] > ids[i]/ @ packed_search_test
../cpu/simd/candidates.h @ s/space_.KeepSmallestIds(nearer, tied, k_ - nearer);// @ packed_search_test
'

copy=build-mutations/source
mkdir -p "$copy"
# Files as new as now: an earlier run has built its last mutation later than the file that it was planted in was changed.
git ls-files -z | tar --null -T - -cf - | tar -C "$copy" -xmf -
cmake -S "$copy" -B build-mutations/build -G Ninja >build-mutations/configure.log
survivors=0
while IFS='@' read -r file expression test; do
  file=$(echo "$file" | xargs) test=$(echo "$test" | xargs)
  [ -n "$file" ] || continue
  expression=$(sed 's/^ *//; s/ *$//' <<<"$expression")
  kernel=$copy/core/kernels/$file
  cp "core/kernels/$file" "$kernel"
  sed -i "$expression" "$kernel"
  if cmp -s "core/kernels/$file" "$kernel"; then
    printf 'NO CHANGE %-18s %s\n' "$file" "$expression"
    survivors=1
    continue
  fi
  ninja -C build-mutations/build "$test" >build-mutations/build.log
  if timeout 120 "build-mutations/build/tests/$test" --gtest_brief=1 >build-mutations/test.log 2>&1; then
    printf 'SURVIVED  %-18s %s\n' "$file" "$expression"
    survivors=1
  else
    printf 'killed    %-18s %-60s by %s\n' "$file" "$expression" "$test"
  fi
  cp "core/kernels/$file" "$kernel"
done <<<"$mutations"
exit $survivors
