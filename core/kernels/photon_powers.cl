// What photons carry beside their positions, brought together: a density reads it at random places.

/// Packs. One work-item per photon.
/// @param powers          [3n] W
/// @param directions      [n] octahedral; read where has_directions
/// @param packed          [n] out; what is not there is 0
kernel void pack_powers(global const float* restrict powers,
                        global const short2* restrict directions, const uint n,
                        const uint has_powers, const uint has_directions,
                        global PhotonPower* restrict packed) {
  const uint i = get_global_id(0);
  if (i >= n) return;
  const float3 power = has_powers ? vload3(i, powers) : (float3)(0.0f);
  const short2 direction = has_directions ? directions[i] : (short2)(0);
  ((global float4*)packed)[i] = (float4)(power, as_float(direction));
}
