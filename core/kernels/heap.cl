// Heaps of candidates. Uses traverse.cl. -DHEAP_SPACE: where they live, `local` or `global`.

// A heap holds its largest candidate on top; its places are heap[0], heap[stride], heap[2 *
// stride], ... Puts `value` in place of the top.
void sift_down(HEAP_SPACE ulong* heap, const uint stride, const uint size, const ulong value) {
  uint place = 0;
  for (uint child = 1; child < size; child = 2 * place + 1) {
    ulong largest = heap[child * stride];
    if (child + 1 < size && heap[(child + 1) * stride] > largest) {
      ++child;
      largest = heap[child * stride];
    }
    if (largest <= value) break;
    heap[place * stride] = largest;
    place = child;
  }
  heap[place * stride] = value;
}

// Puts `value` behind the `size` candidates of the heap.
void sift_up(HEAP_SPACE ulong* heap, const uint stride, const uint size, const ulong value) {
  uint place = size;
  while (place > 0) {
    const uint parent = (place - 1) / 2;
    const ulong above = heap[parent * stride];
    if (above >= value) break;
    heap[place * stride] = above;
    place = parent;
  }
  heap[place * stride] = value;
}

// Sorts a heap to ascending order.
void sort_heap(HEAP_SPACE ulong* heap, const uint stride, const uint size) {
  for (uint last = size; last > 1; --last) {
    const ulong largest = heap[0];
    sift_down(heap, stride, last - 1, heap[(last - 1) * stride]);
    heap[(last - 1) * stride] = largest;
  }
}
