// Queries in the order of their Morton codes, and whether they came in some such order. Uses
// morton.cl.

/// Computes the 30-bit code of every query, numbers the queries, and tells how well they lie in
/// order: 1 is added for each query whose next one is near, at most `near_cells` away along each
/// axis, and not behind it by the codes; 2 are taken for each whose next one is not near. An order
/// by codes of another grid has hardly any that are not near, but many that are behind.
/// 1D range, any work-group size.
/// @param positions  [3n] scene units
/// @param grids      [1]
/// @param codes      [n] out
/// @param ids        [n] out: 0, 1, 2, ...
/// @param score      [1] in: 0; out: at most n - 1
kernel void query_codes(global const float* restrict positions,
                        global const MortonGrid* restrict grids, const uint n,
                        const uint near_cells, global uint* restrict codes,
                        global uint* restrict ids, volatile global int* restrict score) {
  local int scores[32];
  const MortonGrid grid = grids[0];
  const uint i = get_global_id(0), item = get_local_id(0);
  if (item < 32) scores[item] = 0;
  // Scores are cleared before items add to them.
  barrier(CLK_LOCAL_MEM_FENCE);
  if (i < n) {
    const uint3 cells = morton_cells_30(load_position(positions, i), grid);
    const uint3 next = morton_cells_30(load_position(positions, min(i + 1, n - 1)), grid);
    const uint code = interleave_30(cells);
    codes[i] = code;
    ids[i] = i;
    const uint3 apart = abs_diff(cells, next);
    const bool near = max(max(apart.x, apart.y), apart.z) <= near_cells;
    if (i + 1 < n)
      atomic_add(&scores[item % 32], near ? (code <= interleave_30(next) ? 1 : 0) : -2);
  }
  // All items have added.
  barrier(CLK_LOCAL_MEM_FENCE);
  if (item > 0) return;
  int sum = 0;
  for (uint j = 0; j < 32; ++j) sum += scores[j];
  atomic_add(score, sum);
}
