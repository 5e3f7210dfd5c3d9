// Calls the kernels of radix_sort_onesweep.cl, which is compiled before it. -DCOUNT, -DPASS: the
// names of the calls in radix_sort.h.

void COUNT(const RadixSortArguments* a) {
  sweep_count(a->keys, a->n, a->pass_count, a->found, a->most, a->sweep);
}

void PASS(const RadixSortArguments* a) {
  sweep_pass(a->keys, a->values, a->n, a->shift, a->found, a->most, a->sweep, a->bins_at,
             a->tiles_at, a->states_at, a->keys_out, a->values_out);
}
