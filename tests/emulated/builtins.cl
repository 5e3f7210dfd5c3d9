// The functions of OpenCL C that the kernels of the emulation call, on the host.

#define BUILTIN __attribute__((overloadable))

size_t emulated_local_id(void);
size_t emulated_local_size(void);
size_t emulated_group_id(void);
size_t emulated_group_count(void);
size_t BUILTIN get_local_id(uint dimension) { return emulated_local_id(); }
size_t BUILTIN get_local_size(uint dimension) { return emulated_local_size(); }
size_t BUILTIN get_group_id(uint dimension) { return emulated_group_id(); }
size_t BUILTIN get_global_id(uint dimension) {
  return emulated_group_id() * emulated_local_size() + emulated_local_id();
}
size_t BUILTIN get_global_size(uint dimension) {
  return emulated_group_count() * emulated_local_size();
}

const uint* emulated_exchange(uint function, uint value);
void BUILTIN barrier(cl_mem_fence_flags flags) { emulated_exchange(1, 0); }

uint BUILTIN popcount(uint x) { return __builtin_popcount(x); }
uint BUILTIN clz(uint x) { return x == 0 ? 32 : __builtin_clz(x); }
uint BUILTIN ctz(uint x) { return x == 0 ? 32 : __builtin_ctz(x); }
uint BUILTIN min(uint a, uint b) { return a < b ? a : b; }
uint BUILTIN max(uint a, uint b) { return a > b ? a : b; }
int BUILTIN min(int a, int b) { return a < b ? a : b; }
int BUILTIN max(int a, int b) { return a > b ? a : b; }
int3 BUILTIN max(int3 a, int3 b) { return (int3)(max(a.x, b.x), max(a.y, b.y), max(a.z, b.z)); }
int3 BUILTIN max(int3 a, int b) { return max(a, (int3)(b)); }

float BUILTIN fabs(float x) { return __builtin_fabsf(x); }
float BUILTIN sqrt(float x) { return __builtin_sqrtf(x); }
float BUILTIN fmin(float a, float b) { return __builtin_fminf(a, b); }
float BUILTIN fmax(float a, float b) { return __builtin_fmaxf(a, b); }
float3 BUILTIN fmin(float3 a, float3 b) {
  return (float3)(fmin(a.x, b.x), fmin(a.y, b.y), fmin(a.z, b.z));
}
float3 BUILTIN fmax(float3 a, float3 b) {
  return (float3)(fmax(a.x, b.x), fmax(a.y, b.y), fmax(a.z, b.z));
}
float BUILTIN dot(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
int3 BUILTIN isfinite(float3 v) {
  return (int3)(-__builtin_isfinite(v.x), -__builtin_isfinite(v.y), -__builtin_isfinite(v.z));
}
float3 BUILTIN select(float3 a, float3 b, int3 c) {
  return (float3)(c.x < 0 ? b.x : a.x, c.y < 0 ? b.y : a.y, c.z < 0 ? b.z : a.z);
}
float3 BUILTIN vload3(size_t i, const float* p) {
  return (float3)(p[3 * i], p[3 * i + 1], p[3 * i + 2]);
}
void BUILTIN vstore3(float3 v, size_t i, float* p) {
  p[3 * i] = v.x;
  p[3 * i + 1] = v.y;
  p[3 * i + 2] = v.z;
}

// As far off as those of a GPU: no answer may depend on them.
float BUILTIN native_divide(float a, float b) { return a / b * 1.0000002f; }
float BUILTIN native_recip(float x) { return native_divide(1.0f, x); }

// Items do not run at once: what comes between two calls of sub_group.cl is atomic.
uint add(volatile uint* p, uint value) {
  const uint before = *p;
  *p = before + value;
  return before;
}
uint BUILTIN atomic_add(volatile local uint* p, uint value) { return add(p, value); }
uint BUILTIN atomic_add(volatile global uint* p, uint value) { return add(p, value); }
uint BUILTIN atomic_inc(volatile local uint* p) { return add(p, 1); }
uint BUILTIN atomic_inc(volatile global uint* p) { return add(p, 1); }
uint BUILTIN atomic_load_explicit(volatile atomic_uint* p, memory_order order, memory_scope scope) {
  return *(volatile uint*)p;
}
void BUILTIN atomic_store_explicit(volatile atomic_uint* p, uint value, memory_order order,
                                   memory_scope scope) {
  *(volatile uint*)p = value;
}
