// Morton codes of positions: the cell numbers of the three axes interleaved, x in the highest bit
// (Morton 1966; Karras 2012, section 4).

// Spreads the lowest 10 bits of `v` to every third bit.
uint spread_10(uint v) {
  v = (v | (v << 16)) & 0x030000ffu;
  v = (v | (v << 8)) & 0x0300f00fu;
  v = (v | (v << 4)) & 0x030c30c3u;
  return (v | (v << 2)) & 0x09249249u;
}

// Spreads the lowest 21 bits of `v` to every third bit.
ulong spread_21(ulong v) {
  v = (v | (v << 32)) & 0x001f00000000fffful;
  v = (v | (v << 16)) & 0x001f0000ff0000fful;
  v = (v | (v << 8)) & 0x100f00f00f00f00ful;
  v = (v | (v << 4)) & 0x10c30c30c30c30c3ul;
  return (v | (v << 2)) & 0x1249249249249249ul;
}

// Cell of `p` on `axis`, in [0, last]. Monotonic in p, so cells never cross: rounding keeps order
// in every step. The comparison is made before the conversion, which is undefined for numbers too
// large.
uint morton_cell(const float p, const MortonGrid grid, const uint axis, const uint last) {
  const float cell = (p - grid.min[axis]) * grid.prescale * grid.scale[axis];
  return cell >= (float)last ? last : (uint)fmax(cell, 0.0f);
}

// Cells of `p` in a grid of 1024^3.
uint3 morton_cells_30(const float3 p, const MortonGrid grid) {
  return (uint3)(morton_cell(p.x, grid, 0, 1023), morton_cell(p.y, grid, 1, 1023),
                 morton_cell(p.z, grid, 2, 1023));
}

uint interleave_30(const uint3 cells) {
  return (spread_10(cells.x) << 2) | (spread_10(cells.y) << 1) | spread_10(cells.z);
}

// 30-bit code of `p` in `grid`.
uint morton_code_30(const float3 p, const MortonGrid grid) {
  return interleave_30(morton_cells_30(p, grid));
}

/// Computes the 30-bit Morton code of every photon and numbers the photons.
/// One work-item per photon, 1D range, any work-group size.
/// @param positions  [3n] x, y, z of each photon, scene units
/// @param grids      [1]
/// @param codes      [n] out: code of each photon
/// @param ids        [n] out: index of each photon, 0, 1, 2, ...
kernel void morton_codes_30(global const float* restrict positions,
                            global const MortonGrid* restrict grids, const uint n,
                            global uint* restrict codes, global uint* restrict ids) {
  const uint i = get_global_id(0);
  if (i >= n) return;
  codes[i] = morton_code_30(load_position(positions, i), grids[0]);
  ids[i] = i;
}

/// Computes the 63-bit Morton code of every photon and numbers the photons; else as
/// morton_codes_30.
kernel void morton_codes_63(global const float* restrict positions,
                            global const MortonGrid* restrict grids, const uint n,
                            global ulong* restrict codes, global uint* restrict ids) {
  const uint i = get_global_id(0);
  if (i >= n) return;
  const MortonGrid grid = grids[0];
  const float3 p = load_position(positions, i);
  const uint last = (1u << 21) - 1;
  codes[i] = (spread_21(morton_cell(p.x, grid, 0, last)) << 2) |
             (spread_21(morton_cell(p.y, grid, 1, last)) << 1) |
             spread_21(morton_cell(p.z, grid, 2, last));
  ids[i] = i;
}
