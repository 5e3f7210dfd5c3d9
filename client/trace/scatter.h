#ifndef TREELIGHT_CLIENT_TRACE_SCATTER_H_
#define TREELIGHT_CLIENT_TRACE_SCATTER_H_

#include "client/trace/dielectric.h"
#include "client/trace/intersector.h"

namespace treelight::client {

// How a path goes on from a hit; photons and camera rays scatter alike. Radiance is carried divided
// by the squared index of its medium, so that refraction leaves it as it is (Veach 1997,
// section 5.2); lights and cameras stand in air.

/// What the dielectric at `hit` does with the light, or the view, along `ray`.
DielectricSplit SplitAtHit(const Ray& ray, const Hit& hit);

/// The direction in which a path goes on, drawn by (u, v): about the normal for kDiffuse (density
/// cos / pi), the mirror direction for kMirror, reflected with probability R and else refracted for
/// kDielectric. The path's weight is then to be multiplied with the reflectance, except for
/// kDielectric.
Vec3 SampleScattering(const Ray& ray, const Hit& hit, float u, float v);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_SCATTER_H_
