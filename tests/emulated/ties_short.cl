// Calls the kernel of core/kernels/ties_short.cl, which is compiled before it.

void run_tie_short_runs(const TiesArguments* a) {
  tie_short_runs(a->positions, a->n, a->max_leaf_size, a->base, a->ids, a->levels, a->rest);
}
