#ifndef TREELIGHT_CLIENT_SCENES_COLOR_H_
#define TREELIGHT_CLIENT_SCENES_COLOR_H_

#include <algorithm>

namespace treelight::client {

/// Linear red, green and blue; the unit is the user's: reflectance, W, W/m^2/sr.
struct Rgb {
  float r = 0, g = 0, b = 0;

  Rgb& operator+=(const Rgb& c) {
    r += c.r, g += c.g, b += c.b;
    return *this;
  }
  friend Rgb operator+(Rgb a, const Rgb& b) { return a += b; }
  friend Rgb operator-(const Rgb& a, const Rgb& b) { return {a.r - b.r, a.g - b.g, a.b - b.b}; }
  friend Rgb operator*(const Rgb& a, const Rgb& b) { return {a.r * b.r, a.g * b.g, a.b * b.b}; }
  friend Rgb operator*(float s, const Rgb& c) { return {s * c.r, s * c.g, s * c.b}; }
  friend bool operator==(const Rgb&, const Rgb&) = default;
};

/// The largest of the three channels.
inline float MaxChannel(const Rgb& c) { return std::max({c.r, c.g, c.b}); }

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_SCENES_COLOR_H_
