// Where two work-items meet at a node of a tree, the second to come carries on.

#if __OPENCL_C_VERSION__ >= 300
typedef atomic_uint Meeting;
#define EXCHANGE(meeting, value) \
  atomic_exchange_explicit(meeting, value, memory_order_acq_rel, memory_scope_device)
#define GROUP_FENCE()                                                                          \
  atomic_work_item_fence(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE, memory_order_acq_rel, \
                         memory_scope_work_group)
#else
// OpenCL C 1.2 orders memory within a work-group only. Its fence and atomic are fences of the
// device on x86 (PoCL).
typedef uint Meeting;
uint fenced_exchange(volatile global uint* meeting, const uint value) {
  mem_fence(CLK_GLOBAL_MEM_FENCE);
  const uint old = atomic_xchg(meeting, value);
  mem_fence(CLK_GLOBAL_MEM_FENCE);
  return old;
}
#define EXCHANGE(meeting, value) fenced_exchange(meeting, value)
#define GROUP_FENCE() mem_fence(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE)
#endif

// GROUP_FENCE: with a barrier of local memory behind it, what the items of a work-group wrote to
// global memory is seen by those who fence after the barrier.
