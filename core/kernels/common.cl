// What every kernel file begins with, after types.h.

// Distances must have the same bits on every device, so a*b+c stays two rounded operations.
#pragma OPENCL FP_CONTRACT OFF

// Position of photon `i`, scene units. Adding zero turns -0 into +0, whose order fmin and fmax
// leave open.
float3 load_position(global const float* restrict positions, const uint i) {
  return vload3(i, positions) + 0.0f;
}

// The photon at place `i` of the leaf order: x, y, z, the bits of its index. One read of 16 bytes.
float4 load_photon(global const LeafPhoton* restrict photons, const uint i) {
  return ((global const float4*)photons)[i];
}

// Unsigned number that orders as `value` does; value is not NaN.
uint ordered_bits(const float value) {
  const uint bits = as_uint(value);
  return bits ^ ((bits & 0x80000000u) != 0 ? 0xffffffffu : 0x80000000u);
}

// Inverse of ordered_bits.
float from_ordered_bits(const uint ordered) {
  return as_float(ordered ^ ((ordered & 0x80000000u) != 0 ? 0x80000000u : 0xffffffffu));
}
