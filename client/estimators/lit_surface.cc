#include "client/estimators/lit_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace treelight::client {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();
constexpr int kCausticsPerSide = 4;
constexpr double kBeside = 5;  // sigma

/// Numbers that are the same with every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  double Uniform() { return static_cast<double>(engine_() >> 11) * 0x1p-53; }  // [0, 1)

  /// Two independent ones (Box and Muller 1958).
  std::array<double, 2> Gaussians() {
    const double radius = std::sqrt(-2 * std::log(1 - Uniform())),
                 angle = 2 * std::numbers::pi * Uniform();
    return {radius * std::cos(angle), radius * std::sin(angle)};
  }

  std::array<double, 3> OnUnitSphere() {
    const double z = 2 * Uniform() - 1, angle = 2 * std::numbers::pi * Uniform(),
                 radius = std::sqrt(1 - z * z);
    return {radius * std::cos(angle), radius * std::sin(angle), z};
  }

 private:
  std::mt19937_64 engine_;
};

void Append(std::vector<float>& positions, double x, double y, double z) {
  for (const double c : {x, y, z}) positions.push_back(static_cast<float>(c));
}

/// Places along a unit length: more where photons are many, so that their gathers stay apart.
int PlacesPerSide(std::uint64_t photon_count) {
  return photon_count < 10'000 ? 1 : photon_count < 100'000 ? 2 : photon_count < 1'000'000 ? 4 : 8;
}

LitSurface MakeSquare(std::uint64_t photon_count, Random& random) {
  LitSurface surface;
  for (std::uint64_t i = 0; i < photon_count; ++i) {
    const double x = random.Uniform();
    Append(surface.photons.positions, x, random.Uniform(), 0);
  }
  const auto density = static_cast<double>(photon_count);
  const int side = PlacesPerSide(photon_count);
  KnownPlaces plane{.name = "plane", .queries = {}, .density = density, .reach = 0.5 / side};
  KnownPlaces edge{.name = "edge", .queries = {}, .density = density, .reach = 0.5 / side};
  for (int i = 0; i < side; ++i) {
    const double u = (i + 0.5) / side;
    for (int j = 0; j < side; ++j) Append(plane.queries, u, (j + 0.5) / side, 0);
    for (const double border : {0.0, 1.0}) {
      Append(edge.queries, u, border, 0);
      Append(edge.queries, border, u, 0);
    }
  }
  surface.places = {plane, edge};
  surface.mean_density = density;
  return surface;
}

LitSurface MakeCube(std::uint64_t photon_count, Random& random) {
  LitSurface surface;
  for (std::uint64_t i = 0; i < photon_count; ++i) {
    const auto wall = static_cast<std::size_t>(6 * random.Uniform());
    std::array<double, 3> p{};
    p[wall / 2] = static_cast<double>(wall % 2);
    p[(wall / 2 + 1) % 3] = random.Uniform();
    p[(wall / 2 + 2) % 3] = random.Uniform();
    Append(surface.photons.positions, p[0], p[1], p[2]);
  }
  const double density = static_cast<double>(photon_count) / 6;
  const int side = PlacesPerSide(photon_count);
  KnownPlaces two{.name = "corner_2", .queries = {}, .density = density, .reach = 0.5 / side};
  KnownPlaces three{.name = "corner_3", .queries = {}, .density = density, .reach = 0.5};
  for (int corner = 0; corner < 8; ++corner) {
    const double x = corner & 1, y = corner >> 1 & 1, z = corner >> 2;
    Append(three.queries, x, y, z);
    for (int i = 0; i < side; ++i) {
      const double u = (i + 0.5) / side;
      if (corner < 4) Append(two.queries, x, y, u);
      if (corner % 4 < 2) Append(two.queries, x, u, z);
      if (corner % 2 < 1) Append(two.queries, u, y, z);
    }
  }
  surface.places = {two, three};
  surface.mean_density = density;
  return surface;
}

LitSurface MakeCaustics(std::uint64_t photon_count, Random& random) {
  constexpr int kCaustics = kCausticsPerSide * kCausticsPerSide;
  const auto middle = [](int i) { return (i + 0.5) / kCausticsPerSide; };
  LitSurface surface;
  for (std::uint64_t i = 0; i < photon_count; ++i) {
    if (random.Uniform() < 0.5) {
      const double x = random.Uniform();
      Append(surface.photons.positions, x, random.Uniform(), 0);
      continue;
    }
    const auto caustic = static_cast<int>(kCaustics * random.Uniform());
    const auto [u, v] = random.Gaussians();
    Append(surface.photons.positions, middle(caustic % kCausticsPerSide) + kCausticSigma * u,
           middle(caustic / kCausticsPerSide) + kCausticSigma * v, 0);
  }
  const double floor = static_cast<double>(photon_count) / 2;
  const double top = floor / kCaustics / (2 * std::numbers::pi * kCausticSigma * kCausticSigma);
  KnownPlaces peak{.name = "peak", .queries = {}, .density = floor + top, .reach = kUnlimited};
  KnownPlaces beside{.name = "beside",
                     .queries = {},
                     .density = floor + top * std::exp(-kBeside * kBeside / 2),
                     .reach = kUnlimited};
  for (int i = 0; i < kCaustics; ++i) {
    const double x = middle(i % kCausticsPerSide), y = middle(i / kCausticsPerSide);
    Append(peak.queries, x, y, 0);
    // Outwards from the middle of the square or inwards makes no difference: the next is 7.5 sigma
    // away.
    Append(beside.queries, x + kBeside * kCausticSigma, y, 0);
  }
  surface.places = {peak, beside};
  surface.mean_density = 2 * floor;
  return surface;
}

/// @param size  radius of the spheres, relative to that of a disc that holds k photons
LitSurface MakeSpheres(const std::string& name, std::uint64_t photon_count, std::uint32_t k,
                       double size, Random& random) {
  const double density = k / std::numbers::pi;  // a disc of radius 1 holds k
  const auto on_each = static_cast<std::uint64_t>(std::llround(4 * k * size * size));
  const std::uint64_t spheres = std::max<std::uint64_t>(1, photon_count / on_each);
  const auto side = static_cast<std::uint64_t>(std::ceil(std::cbrt(static_cast<double>(spheres))));
  constexpr double kApart = 10;
  LitSurface surface;
  KnownPlaces places{.name = name, .queries = {}, .density = density, .reach = kUnlimited};
  // As many on a sphere as chance gives it.
  std::vector<std::array<double, 3>> middles;
  for (std::uint64_t i = 0; i < spheres; ++i) {
    middles.push_back({kApart * static_cast<double>(i % side),
                       kApart * static_cast<double>(i / side % side),
                       kApart * static_cast<double>(i / side / side)});
    const auto [x, y, z] = random.OnUnitSphere();
    const auto& m = middles.back();
    Append(places.queries, m[0] + size * x, m[1] + size * y, m[2] + size * z);
  }
  for (std::uint64_t i = 0; i < spheres * on_each; ++i) {
    const auto& m =
        middles[static_cast<std::size_t>(random.Uniform() * static_cast<double>(spheres))];
    const auto [x, y, z] = random.OnUnitSphere();
    Append(surface.photons.positions, m[0] + size * x, m[1] + size * y, m[2] + size * z);
  }
  // What on_each rounds away.
  places.density = static_cast<double>(on_each) / (4 * std::numbers::pi * size * size);
  surface.places = {places};
  surface.mean_density = density;
  return surface;
}

LitSurface Make(SurfaceKind kind, std::uint64_t photon_count, std::uint32_t k, Random& random) {
  switch (kind) {
    case SurfaceKind::kSquare:
      return MakeSquare(photon_count, random);
    case SurfaceKind::kCube:
      return MakeCube(photon_count, random);
    case SurfaceKind::kCaustics:
      return MakeCaustics(photon_count, random);
    case SurfaceKind::kSpheres:
      return MakeSpheres("sphere", photon_count, k, 1, random);
    case SurfaceKind::kSmallSpheres:
      return MakeSpheres("small_sphere", photon_count, k, 1.0 / 3, random);
  }
  return {};
}

}  // namespace

LitSurface MakeLitSurface(SurfaceKind kind, std::uint64_t photon_count, std::uint32_t k,
                          std::uint64_t seed) {
  Random random(seed);
  LitSurface surface = Make(kind, photon_count, k, random);
  surface.photons.powers.assign(surface.photons.positions.size(), 1.0f);
  return surface;
}

double FixedRadius(double density, std::uint32_t k) {
  return std::sqrt(k / (std::numbers::pi * density));
}

}  // namespace treelight::client
