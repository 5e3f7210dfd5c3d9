// A subtree in local memory, while a sweep rebuilds it: its photons in the order of each axis, worked
// on in chunks of a few places, a work-item for each, whatever nodes they belong to.

#ifndef SUBTREE_SIZE
#define SUBTREE_SIZE 256  // photons of a subtree at most, a power of two
#endif
#ifndef MAX_NODES
#define MAX_NODES (SUBTREE_SIZE / 2)  // of one depth that are still to be cut
#endif
#define NO_NODE 0xffffu
#define CHUNK 8
#define CHUNKS (SUBTREE_SIZE / CHUNK)

// Behind a photon that is not the last of its leaf.
#define LEVEL_INSIDE 255

typedef struct Subtree {
  float coordinates[3][SUBTREE_SIZE];  // by slot, the place in the order of the input
  ushort orders[2][3][SUBTREE_SIZE];   // slots in the order of each axis: one is read, one written
  ushort order[SUBTREE_SIZE];          // slots in leaf order, as far as it is known
  ushort node_of[SUBTREE_SIZE];        // by place: the node that is to be cut, or NO_NODE
  uchar goes_right[SUBTREE_SIZE];      // by slot
  uchar levels[SUBTREE_SIZE];          // behind each place
  // Of each chunk, where a node reaches over its front or its back: the box of that node's photons
  // in the chunk, how many of them go right, and the best of their cuts.
  float heads[6][3][CHUNKS], tails[6][3][CHUNKS];
  uchar tail_rights[3][CHUNKS];
  float chunk_costs[3][CHUNKS];
  ushort chunk_places[3][CHUNKS];
  // Nodes of this depth and of the next.
  uint node_counts[2];
  ushort firsts[2][MAX_NODES], lasts[2][MAX_NODES];  // places
  // Nodes of this depth: the best cut of each axis, then of all.
  float node_costs[3][MAX_NODES];
  ushort node_places[3][MAX_NODES];
  uchar axes[MAX_NODES];
  ushort left_nodes[MAX_NODES], right_nodes[MAX_NODES];  // children, or NO_NODE
} Subtree;

// Places [begin, end) of one node in one chunk.
typedef struct Run {
  uint begin, end;
  uint node;
  uint first, last;  // of the node
} Run;

// The run at `place`, or behind it, in the chunk that ends at `end`. False: there is none.
bool find_run(local const Subtree* tree, const uint now, const uint place, const uint end,
              Run* run) {
  for (uint i = place; i < end; ++i) {
    const uint node = tree->node_of[i];
    if (node == NO_NODE) continue;
    run->begin = i;
    run->node = node;
    run->first = tree->firsts[now][node];
    run->last = tree->lasts[now][node];
    run->end = min(end, run->last);
    return true;
  }
  return false;
}

void store_box(local float boxes[6][3][CHUNKS], const uint axis, const uint chunk, const float3 low,
               const float3 high) {
  boxes[0][axis][chunk] = low.x;
  boxes[1][axis][chunk] = low.y;
  boxes[2][axis][chunk] = low.z;
  boxes[3][axis][chunk] = high.x;
  boxes[4][axis][chunk] = high.y;
  boxes[5][axis][chunk] = high.z;
}

void extend_by_box(local float boxes[6][3][CHUNKS], const uint axis, const uint chunk, float3* low,
                   float3* high) {
  *low = fmin(*low, (float3)(boxes[0][axis][chunk], boxes[1][axis][chunk], boxes[2][axis][chunk]));
  *high =
      fmax(*high, (float3)(boxes[3][axis][chunk], boxes[4][axis][chunk], boxes[5][axis][chunk]));
}

float3 position_of(local const Subtree* tree, const uint slot) {
  return (float3)(tree->coordinates[0][slot], tree->coordinates[1][slot],
                  tree->coordinates[2][slot]);
}

// Sorts `padded` slots, a power of two, on each axis by (coordinate, slot): a bitonic network
// (Batcher 1968).
void sort_axes(local Subtree* tree, const uint padded) {
  for (uint size = 2; size <= padded; size *= 2) {
    for (uint stride = size / 2; stride > 0; stride /= 2) {
      // What the step before, or the load, wrote is read by other items.
      barrier(CLK_LOCAL_MEM_FENCE);
      for (uint i = get_local_id(0); i < 3 * padded / 2; i += get_local_size(0)) {
        const uint axis = i / (padded / 2), pair = i % (padded / 2);
        const uint low = 2 * pair - (pair & (stride - 1)), high = low + stride;
        local ushort* order = tree->orders[0][axis];
        const uint a = order[low], b = order[high];
        const float u = tree->coordinates[axis][a], v = tree->coordinates[axis][b];
        if ((u > v || (u == v && a > b)) == ((low & size) == 0)) {
          order[low] = (ushort)b;
          order[high] = (ushort)a;
        }
      }
    }
  }
}
