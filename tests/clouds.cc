#include "tests/clouds.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "core/model/octahedral.h"

namespace treelight {
namespace {

using Generator = std::mt19937;

float Uniform(Generator& random, float low = 0, float high = 1) {
  return std::uniform_real_distribution<float>(low, high)(random);
}

float Gaussian(Generator& random, float sigma) {
  return std::normal_distribution<float>(0, sigma)(random);
}

/// Calls `point`, which returns x, y, z, for every point.
template <typename Point>
std::vector<float> Fill(std::size_t count, std::uint32_t seed, Point&& point) {
  Generator random(seed);
  std::vector<float> positions;
  positions.reserve(3 * count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::array<float, 3> p = point(random, i);
    positions.insert(positions.end(), p.begin(), p.end());
  }
  return positions;
}

std::array<float, 3> InCube(Generator& random) {
  const float x = Uniform(random), y = Uniform(random);
  return {x, y, Uniform(random)};
}

std::vector<float> UniformCube(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t) { return InCube(random); });
}

/// Walls of a cube, a third of the photons in caustic patches, 2 % copies of the photon before.
std::vector<float> Surfaces(std::size_t count, std::uint32_t seed) {
  std::array<float, 3> last{};
  return Fill(count, seed, [&last](Generator& random, std::size_t i) {
    if (i > 0 && Uniform(random) < 0.02f) return last;
    std::array<float, 3> p = InCube(random);
    const auto axis = static_cast<std::size_t>(Uniform(random, 0, 2.999f));
    p[axis] = Uniform(random) < 0.5f ? 0.0f : 1.0f;
    if (Uniform(random) < 0.3f) {
      const auto patch = static_cast<float>(static_cast<int>(Uniform(random, 0, 5.999f)));
      p = {0.15f + 0.12f * patch + Gaussian(random, 0.01f), 0, 0.5f + Gaussian(random, 0.01f)};
    }
    return last = p;
  });
}

std::vector<float> AllEqual(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator&, std::size_t) { return std::array{0.3f, -2.0f, 7.0f}; });
}

std::vector<float> HalfOneDuplicate(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t i) {
    return i % 2 == 0 ? std::array{0.5f, 0.5f, 0.5f} : InCube(random);
  });
}

std::vector<float> ManyDuplicates(std::size_t count, std::uint32_t seed) {
  const std::size_t distinct = std::max<std::size_t>(1, count / 200);
  const std::vector<float> base = UniformCube(distinct, seed + 1);
  return Fill(count, seed, [&](Generator&, std::size_t i) {
    const std::size_t j = 3 * (i % distinct);
    return std::array{base[j], base[j + 1], base[j + 2]};
  });
}

std::vector<float> Collinear(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t) {
    const float t = Uniform(random);
    return std::array{t, t, t};
  });
}

std::vector<float> AxisLine(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t) {
    return std::array{0.0f, Uniform(random), 0.0f};
  });
}

std::vector<float> Coplanar(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t) {
    const float x = Uniform(random);
    return std::array{x, Uniform(random), 0.0f};
  });
}

std::vector<float> ObliquePlane(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t) {
    const float u = Uniform(random), v = Uniform(random);
    return std::array{u, v, 0.3f * u + 0.7f * v};
  });
}

std::vector<float> IntegerGrid(std::size_t count, std::uint32_t seed) {
  const auto side = static_cast<std::size_t>(
      std::ceil(std::cbrt(static_cast<double>(std::max<std::size_t>(count, 1)))));
  return Fill(count, seed, [side](Generator&, std::size_t i) {
    return std::array{static_cast<float>(i % side), static_cast<float>(i / side % side),
                      static_cast<float>(i / side / side)};
  });
}

std::vector<float> TwoFarClusters(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t i) {
    std::array<float, 3> p = InCube(random);
    for (float& c : p) c = 0.1f * c + (i % 2 == 0 ? 0.0f : 1000.0f);
    return p;
  });
}

std::vector<float> OneOutlier(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t i) {
    return i == 0 ? std::array{1e6f, 1e6f, 1e6f} : InCube(random);
  });
}

std::vector<float> OutlierOnX(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t i) {
    std::array<float, 3> p = InCube(random);
    if (i == 0) p[0] = 1e6f;
    return p;
  });
}

/// Half of the points in each octave towards a corner, scales 2^0 to 2^-40.
std::vector<float> GeometricScales(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t i) {
    std::array<float, 3> p = InCube(random);
    for (float& c : p) c = std::ldexp(c, -static_cast<int>(i % 41));
    return p;
  });
}

/// Scales so far apart that codes of three rounds cannot tell them apart: medians must.
std::vector<float> ExtremeScales(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t i) {
    std::array<float, 3> p = InCube(random);
    for (float& c : p) c = std::ldexp(c, 40 - static_cast<int>(i % 160));
    return p;
  });
}

std::vector<float> OffsetMillion(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t) {
    std::array<float, 3> p = InCube(random);
    for (float& c : p) c += 1e6f;
    return p;
  });
}

/// Floats are 64 apart there: planes of a grid, with duplicates.
std::vector<float> OffsetBillion(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t) {
    std::array<float, 3> p = InCube(random);
    for (float& c : p) c = 1e9f + 1e3f * c;
    return p;
  });
}

/// Half of the photons in a patch of a floor where they lie 1e5 times as dense as on the rest.
std::vector<float> DenseCaustic(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t i) {
    const float side = i % 2 == 0 ? 1.0f : 3.1622777e-3f;
    const float x = side * Uniform(random);
    return std::array{x, 0.0f, side * Uniform(random)};
  });
}

std::vector<float> Denormal(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t) {
    std::array<float, 3> p = InCube(random);
    for (float& c : p) c *= 1e-40f;
    return p;
  });
}

std::vector<float> Huge(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t) {
    std::array<float, 3> p = InCube(random);
    for (float& c : p) c = (c - 0.5f) * 2e17f;
    return p;
  });
}

/// As far as coordinates may be.
std::vector<float> Largest(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t i) {
    std::array<float, 3> p = InCube(random);
    for (float& c : p) c = (2 * c - 1) * kMaxCoordinate;
    p[i % 3] = i % 2 == 0 ? kMaxCoordinate : -kMaxCoordinate;
    return p;
  });
}

std::vector<float> SignedZeros(std::size_t count, std::uint32_t seed) {
  return Fill(count, seed, [](Generator& random, std::size_t i) {
    return std::array{i % 2 == 0 ? 0.0f : -0.0f, Uniform(random, -1, 1), i % 3 == 0 ? 0.0f : -0.0f};
  });
}

}  // namespace

const std::vector<CloudShape>& AllClouds() {
  static const std::vector<CloudShape> shapes = {
      {"uniform", UniformCube},
      {"surfaces", Surfaces},
      {"all_equal", AllEqual},
      {"half_one_duplicate", HalfOneDuplicate},
      {"many_duplicates", ManyDuplicates},
      {"collinear", Collinear},
      {"axis_line", AxisLine},
      {"coplanar", Coplanar},
      {"oblique_plane", ObliquePlane},
      {"integer_grid", IntegerGrid},
      {"two_far_clusters", TwoFarClusters},
      {"one_outlier", OneOutlier},
      {"outlier_on_x", OutlierOnX},
      {"geometric_scales", GeometricScales},
      {"extreme_scales", ExtremeScales},
      {"offset_million", OffsetMillion},
      {"offset_billion", OffsetBillion},
      {"dense_caustic", DenseCaustic},
      {"denormal", Denormal},
      {"huge", Huge},
      {"largest", Largest},
      {"signed_zeros", SignedZeros},
  };
  return shapes;
}

std::vector<std::string> CloudNames() {
  std::vector<std::string> names;
  for (const CloudShape& shape : AllClouds()) names.push_back(shape.name);
  return names;
}

const CloudShape& CloudNamed(const std::string& name) {
  for (const CloudShape& shape : AllClouds()) {
    if (shape.name == name) return shape;
  }
  std::fprintf(stderr, "no cloud is named %s\n", name.c_str());
  std::abort();
}

Photons MakeCloud(const CloudShape& shape, std::size_t count, std::uint32_t seed) {
  Photons photons;
  photons.positions = shape.make(count, seed);
  Generator random(seed + 1000);
  for (std::size_t i = 0; i < count; ++i) {
    for (int c = 0; c < 3; ++c) photons.powers.push_back(Uniform(random, 0.5f, 1.5f));
    const float z = Uniform(random, -1, 1), angle = Uniform(random, 0, 6.2831853f),
                r = std::sqrt(1 - z * z);
    const auto encoded = EncodeOctahedral({r * std::cos(angle), r * std::sin(angle), z});
    photons.directions.insert(photons.directions.end(), encoded.begin(), encoded.end());
  }
  return photons;
}

std::vector<float> MakeQueries(const Photons& photons, std::size_t count, std::uint32_t seed) {
  Box box;
  for (std::size_t i = 0; i < photons.size(); ++i) box.Extend(photons.position(i));
  const float extent =
      photons.size() == 0
          ? 1.0f
          : std::max({box.max.x - box.min.x, box.max.y - box.min.y, box.max.z - box.min.z});
  return Fill(count, seed, [&](Generator& random, std::size_t i) {
    if (photons.size() == 0) return InCube(random);
    const auto id =
        static_cast<std::size_t>(Uniform(random) * 0.999999f * static_cast<float>(photons.size()));
    const Vec3 p = photons.position(std::min(id, photons.size() - 1));
    const float reach = i % 4 == 0 ? 0.0f : i % 4 == 3 ? 2 * extent : 1e-3f * extent;
    std::array query{p.x + reach * Uniform(random, -1, 1), p.y + reach * Uniform(random, -1, 1),
                     p.z + reach * Uniform(random, -1, 1)};
    for (float& c : query) c = std::clamp(c, -kMaxCoordinate, kMaxCoordinate);
    return query;
  });
}

}  // namespace treelight
