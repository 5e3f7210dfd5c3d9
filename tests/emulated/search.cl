// Calls the kernel that is compiled before it. -DCALL: the name of the call in search.h.

void CALL(const SearchArguments* a) {
#if defined GATHER_WIDE
  gather_wide(a->boxes, a->wide, a->sizes, a->photons, a->powers, a->positions, a->order,
              a->radii_in, a->normals, a->params, a->counts, a->radii, a->neighbor_ids,
              a->neighbor_d2, a->densities);
#elif defined GATHER_LONG
  gather_long(a->boxes, a->wide, a->sizes, a->photons, a->powers, a->positions, a->order,
              a->radii_in, a->normals, a->params, a->counts, a->radii, a->neighbor_ids,
              a->neighbor_d2, a->densities, a->list_size, a->all_lists);
#elif defined COUNT_WIDE
  count_wide(a->boxes, a->wide, a->sizes, a->photons, a->positions, a->order, a->radii_in,
             a->params, a->counts, a->radii);
#elif defined DENSITY_WIDE
  density_wide(a->boxes, a->wide, a->sizes, a->photons, a->powers, a->positions, a->order,
               a->radii_in, a->normals, a->params, a->counts, a->radii, a->densities);
#endif
}
