// Split levels of the sorted codes: the length of the prefix that neighbours share, the delta of
// Karras 2012, section 3, taken between neighbours alone. It decides the whole radix tree (Apetrei
// 2014, section 3).

/// Computes the level of each boundary of sorted 30-bit codes: 0 to 29, kLevelTied where they are
/// equal. One work-item per boundary, 1D range, any work-group size.
/// @param codes   [n] ascending
/// @param levels  [n - 1] out: level between photons i and i + 1
kernel void split_levels_30(global const uint* restrict codes, const uint n,
                            global uchar* restrict levels) {
  const uint i = get_global_id(0);
  if (i + 1 >= n) return;
  const uint difference = codes[i] ^ codes[i + 1];
  levels[i] = (uchar)(difference == 0 ? kLevelTied : clz(difference) - 2);
}

/// The same of 63-bit codes: 0 to 62.
kernel void split_levels_63(global const ulong* restrict codes, const uint n,
                            global uchar* restrict levels) {
  const uint i = get_global_id(0);
  if (i + 1 >= n) return;
  const ulong difference = codes[i] ^ codes[i + 1];
  levels[i] = (uchar)(difference == 0 ? kLevelTied : (uint)clz(difference) - 1);
}
