// Sizes of subtrees from split levels, without the tree.

// Whether the node at boundary `at` holds more than `cap` of the `n` members that boundaries
// divide: it reaches over all boundaries on either side with larger levels, and on the left with
// equal ones. `levels`: from boundary `base` on.
bool is_large(local const uchar* levels, const uint base, const uint at, const uint n,
              const uint cap) {
  const uchar level = levels[at - base];
  uint a = at, b = at + 1;
  while (a > 0 && levels[a - 1 - base] >= level && b - a < cap) --a;
  while (b + 1 < n && levels[b - base] > level && b - a < cap) ++b;
  return b - a + 1 > cap;
}
