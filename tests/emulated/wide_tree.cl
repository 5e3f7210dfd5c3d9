// Calls the kernels of core/kernels/wide_tree.cl, which is compiled before it.

void run_wide_block_firsts(const WideTreeArguments* a) {
  wide_block_firsts(a->places, a->firsts, a->leaf_count, a->levels, a->boxes, a->meets, a->sizes);
}
void run_wide_blocks(const WideTreeArguments* a) { wide_blocks(a->photons, a->stride, a->boxes); }
void run_wide_counts(const WideTreeArguments* a) {
  wide_counts(a->meets, a->stride, a->sizes, a->level, a->max_begins, a->counts);
}
void run_wide_nodes(const WideTreeArguments* a) {
  wide_nodes(a->boxes, a->tree, a->meets, a->stride, a->sizes, a->level, a->max_begins, a->counts);
}
void run_wide_top(const WideTreeArguments* a) {
  wide_top(a->boxes, a->tree, a->meets, a->stride, a->sizes, a->level, a->max_begins);
}
