// Measure of a box that is not empty, as core/model/heuristic.h computes it.
float measure(const float3 low, const float3 high, const MeasureParams params) {
  const float3 d = ((high - low) * params.prescale) * params.scale + params.grow;
  return params.volume != 0 ? (d.x * d.y) * d.z : (d.x * d.y + d.y * d.z) + d.z * d.x;
}
