#include "client/study/hard_inputs.h"

#include <array>
#include <cmath>
#include <functional>
#include <random>

namespace treelight::client {
namespace {

using Position = std::array<float, 3>;

/// Numbers that are the same with every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  float Uniform() { return static_cast<float>(engine_() >> 40) * 0x1p-24f; }  // [0, 1)
  Position InCube(float size) {
    const float x = Uniform(), y = Uniform(), z = Uniform();
    return {size * x, size * y, size * z};
  }

 private:
  std::mt19937_64 engine_;
};

/// Photon `index` of an input.
using Place = std::function<Position(std::uint64_t index, Random& random)>;

HardInput Make(const std::string& name, std::uint64_t count, std::uint64_t seed,
               const Place& place) {
  HardInput input{.name = name, .positions = {}};
  Random random(seed);
  for (std::uint64_t i = 0; i < count; ++i) {
    const Position p = place(i, random);
    input.positions.insert(input.positions.end(), p.begin(), p.end());
  }
  return input;
}

}  // namespace

std::vector<HardInput> MakeHardInputs(std::uint64_t count, std::uint64_t seed) {
  const auto edge = static_cast<std::uint64_t>(std::cbrt(static_cast<double>(count)));
  const auto cube = [](std::uint64_t, Random& random) { return random.InCube(1); };
  const auto make = [&](const char* name, const Place& place) {
    return Make(name, count, seed, place);
  };
  return {make("uniform", cube),
          make("clusters",
               [](std::uint64_t i, Random& random) {
                 Position p = random.InCube(0.1f);
                 if (i % 2 == 1) p[0] += 1000;
                 return p;
               }),
          make("outlier",
               [](std::uint64_t i, Random& random) {
                 return i == 0 ? Position{1e6f, 1e6f, 1e6f} : random.InCube(1);
               }),
          make("x_outlier",
               [](std::uint64_t i, Random& random) {
                 return i == 0 ? Position{1e6f, 0, 0} : random.InCube(1);
               }),
          make("scales",
               [](std::uint64_t i, Random& random) {
                 return random.InCube(std::ldexp(1.0f, -static_cast<int>(i % 41)));
               }),
          make("diagonal",
               [](std::uint64_t, Random& random) {
                 const float t = random.Uniform();
                 return Position{t, t, t};
               }),
          make("duplicates",
               [](std::uint64_t i, Random& random) {
                 return i % 2 == 1 ? Position{0.5f, 0.5f, 0.5f} : random.InCube(1);
               }),
          Make("grid", edge * edge * edge, seed,
               [edge](std::uint64_t i, Random&) {
                 return Position{static_cast<float>(i % edge), static_cast<float>(i / edge % edge),
                                 static_cast<float>(i / edge / edge)};
               }),
          make("identical",
               [](std::uint64_t, Random&) {
                 return Position{0.1f, 0.2f, 0.3f};
               }),
          make("denormal", [](std::uint64_t, Random& random) { return random.InCube(1e-40f); }),
          make("coplanar",
               [](std::uint64_t, Random& random) {
                 const float x = random.Uniform(), y = random.Uniform();
                 return Position{x, y, 0};
               }),
          make("oblique",
               [](std::uint64_t, Random& random) {
                 const float x = random.Uniform(), y = random.Uniform();
                 return Position{x, y, 1 - x - y};
               }),
          make("offset",
               [](std::uint64_t, Random& random) {
                 Position p = random.InCube(1);
                 for (float& c : p) c += 1e6f;
                 return p;
               }),
          make("huge", [](std::uint64_t, Random& random) {
            Position p = random.InCube(1);
            for (float& c : p) c = (2 * c - 1) * 3e38f;
            return p;
          })};
}

}  // namespace treelight::client
