#ifndef TREELIGHT_CLIENT_RENDER_SHRINKING_RADIUS_H_
#define TREELIGHT_CLIENT_RENDER_SHRINKING_RADIUS_H_

#include <cstdint>

#include "client/render/map_gather.h"

namespace treelight::client {

/// Share of the photons of a pass that a progressive estimate keeps, alpha of Hachisuka, Ogaki and
/// Jensen 2008, "Progressive Photon Mapping". The variance of the mean of N passes falls as
/// N^-alpha, its squared bias as N^(2 alpha - 2): with 2/3 both, hence the mean squared error, fall
/// as N^(-2/3), which no other alpha gives (Kaplanyan and Dachsbacher 2013, "Adaptive Progressive
/// Photon Mapping").
inline constexpr double kRadiusAlpha = 2.0 / 3;

/// The squared radius of each pass relative to that of the first, by the recurrence of Knaus and
/// Zwicker 2011, "Progressive Photon Mapping: A Probabilistic Approach", equation 15:
///   s_1 = 1, s_(i+1) = s_i (i + alpha) / (i + 1)
/// from the last of `constant_passes` on. It needs no memory of what earlier passes found: each
/// pass is a picture of its own.
class ShrinkingRadius {
 public:
  /// `constant_passes`, > 0, have the radius of the first.
  explicit ShrinkingRadius(std::uint64_t constant_passes = 1) : constant_passes_(constant_passes) {}

  double squared_scale() const { return squared_scale_; }  ///< s_i, (0, 1]

  /// On to the next pass.
  void Advance();

 private:
  std::uint64_t constant_passes_;
  std::uint64_t pass_ = 1;
  double squared_scale_ = 1;
};

/// The fewest neighbours that an estimate shrinks to. Fewer have no finite variance.
inline constexpr std::uint32_t kMinShrunkNeighbors = 4;

/// `first`, an estimate over squared_scale times its area. The k nearest photons shrink with the
/// radius, k in proportion to the area, so that dense places keep their smaller radius: Knaus and
/// Zwicker start from a radius of each point for that. Once k is kMinShrunkNeighbors the radius
/// alone goes on. The Epanechnikov kernel and the cone are 0 at the k-th photon, so uniform light
/// has no bias whatever k.
EstimateOptions Shrink(const EstimateOptions& first, double squared_scale);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_SHRINKING_RADIUS_H_
