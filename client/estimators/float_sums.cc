#include "client/estimators/float_sums.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <numbers>
#include <utility>

#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr std::size_t kChunk = 1 << 16;
constexpr std::size_t kBlock = 128;

/// One running sum of type T.
template <typename T>
class RunningSum : public FloatSum {
 public:
  void Add(std::span<const float> addends) override {
    T sum = sum_;
    for (const float addend : addends) sum += addend;
    sum_ = sum;
  }
  double Total() const override { return sum_; }

 private:
  T sum_ = 0;
};

class LaneSum : public FloatSum {
 public:
  void Add(std::span<const float> addends) override {
    for (const float addend : addends) sums_[next_++ % sums_.size()] += addend;
  }
  double Total() const override {
    std::array<float, 32> sums = sums_;
    for (std::size_t step = sums.size() / 2; step > 0; step /= 2) {
      for (std::size_t i = 0; i < step; ++i) sums[i] += sums[i + step];
    }
    return sums[0];
  }

 private:
  std::array<float, 32> sums_{};
  std::size_t next_ = 0;
};

class PairwiseSum : public FloatSum {
 public:
  void Add(std::span<const float> addends) override {
    for (const float addend : addends) {
      block_ += addend;
      if (++in_block_ == kBlock) Push();
    }
  }
  double Total() const override {
    float sum = block_;
    for (const float subtree : subtrees_) sum += subtree;
    return sum;
  }

 private:
  /// As a binary counter carries: subtree i has 2^i blocks, where bit i of their count is set.
  void Push() {
    float sum = std::exchange(block_, 0.0f);
    in_block_ = 0;
    std::size_t level = 0;
    for (; blocks_ >> level & 1; ++level) sum += std::exchange(subtrees_[level], 0.0f);
    subtrees_[level] = sum;
    ++blocks_;
  }

  float block_ = 0;
  std::size_t in_block_ = 0, blocks_ = 0;
  std::array<float, 64> subtrees_{};
};

class CompensatedSum : public FloatSum {
 public:
  void Add(std::span<const float> addends) override {
    float sum = sum_, error = error_;
    for (const float addend : addends) {
      const float corrected = addend - error;
      const float next = sum + corrected;
      error = (next - sum) - corrected;
      sum = next;
    }
    sum_ = sum;
    error_ = error;
  }
  double Total() const override { return sum_; }

 private:
  float sum_ = 0, error_ = 0;
};

/// Numbers of photon `index` that depend on nothing else (Steele, Lea and Flood 2014, SplitMix64).
std::uint64_t Mix(std::uint64_t seed, std::uint64_t index) {
  std::uint64_t z = seed * 0xd1342543de82ef95u + (index + 1) * 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return z ^ (z >> 31);
}

float High(std::uint64_t bits) { return static_cast<float>(bits >> 40) * 0x1p-24f; }
float Low(std::uint64_t bits) { return static_cast<float>(bits & 0xffffff) * 0x1p-24f; }

double RelativeError(double sum, long double exact) {
  return static_cast<double>(std::fabs((static_cast<long double>(sum) - exact) / exact));
}

/// A way, and what it took.
struct Method {
  std::string name;
  std::unique_ptr<FloatSum> sum;
  double nanoseconds = 0;
};

absl::Status MeasureArithmetic(std::uint64_t most_photons, std::uint64_t seed,
                               const FloatSumListener& listener) {
  std::vector<Method> methods;
  for (const std::string& name : FloatSumNames()) methods.push_back({name, MakeFloatSum(name), 0});
  std::vector<float> addends(kChunk);
  long double exact = 0;
  std::uint64_t done = 0;
  for (std::uint64_t told = 100; told <= most_photons; told *= 10) {
    while (done < told) {
      const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(kChunk, told - done));
      const std::span<float> chunk = std::span(addends).first(count);
      MakeAddends(done, seed, chunk);
      for (const float addend : chunk) exact += addend;
      for (Method& method : methods) {
        const auto start = std::chrono::steady_clock::now();
        method.sum->Add(chunk);
        method.nanoseconds +=
            std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start)
                .count();
      }
      done += count;
    }
    for (const Method& method : methods) {
      const FloatSumRow row{.method = method.name,
                            .device = {},
                            .photons = told,
                            .error = RelativeError(method.sum->Total(), exact),
                            .nanoseconds = method.nanoseconds / static_cast<double>(told)};
      if (auto status = listener(row); !status.ok()) return status;
    }
  }
  return absl::OkStatus();
}

/// The density of `count` photons in the disc of radius 1 around a query, on the device.
absl::Status MeasureGather(Builder& builder, std::uint64_t count, std::uint64_t seed,
                           const FloatSumListener& listener) {
  Photons photons;
  photons.positions.reserve(3 * count);
  photons.powers.reserve(3 * count);
  long double exact = 0;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t place = Mix(seed, 2 * i), look = Mix(seed, 2 * i + 1);
    // All within the radius, though roundings may move them by a little.
    const double radius = 0.9999 * std::sqrt(High(place)),
                 angle = 2 * std::numbers::pi * Low(place);
    const Vec3 p{static_cast<float>(radius * std::cos(angle)),
                 static_cast<float>(radius * std::sin(angle)), 0};
    const float power = 0.5f + High(look);
    photons.positions.insert(photons.positions.end(), {p.x, p.y, p.z});
    photons.powers.insert(photons.powers.end(), {power, power, power});
    const float squared_distance = SquaredDistance(Vec3{0, 0, 0}, p);
    exact += 2 * (1 - static_cast<long double>(squared_distance)) * power;
  }
  exact /= std::numbers::pi_v<long double>;
  const auto map = builder.Build(photons, {});
  if (!map.ok()) return map.status();
  const std::vector<float> query = {0, 0, 0};
  const auto answer =
      (*map)->Gather({.positions = query}, {.radius = 1, .outputs = kOutputDensity});
  if (!answer.ok()) return answer.status();
  return listener({.method = "gather",
                   .device = (*map)->report().device,
                   .photons = count,
                   .error = RelativeError(answer->densities[0], exact)});
}

}  // namespace

std::vector<std::string> FloatSumNames() {
  return {"float", "lanes_32", "pairwise", "compensated", "double"};
}

std::unique_ptr<FloatSum> MakeFloatSum(const std::string& name) {
  if (name == "float") return std::make_unique<RunningSum<float>>();
  if (name == "lanes_32") return std::make_unique<LaneSum>();
  if (name == "pairwise") return std::make_unique<PairwiseSum>();
  if (name == "compensated") return std::make_unique<CompensatedSum>();
  return std::make_unique<RunningSum<double>>();
}

void MakeAddends(std::uint64_t first, std::uint64_t seed, std::span<float> addends) {
  for (std::size_t i = 0; i < addends.size(); ++i) {
    const std::uint64_t bits = Mix(seed, first + i);
    addends[i] = 2 * (1 - High(bits)) * (0.5f + Low(bits));
  }
}

absl::Status MeasureFloatSums(Builder& builder, std::uint64_t most_photons,
                              std::uint64_t most_gathered, std::uint64_t seed,
                              const FloatSumListener& listener) {
  if (auto status = MeasureArithmetic(most_photons, seed, listener); !status.ok()) return status;
  for (std::uint64_t count = 100; count <= most_gathered; count *= 10) {
    if (auto status = MeasureGather(builder, count, seed, listener); !status.ok()) return status;
  }
  return absl::OkStatus();
}

std::string FloatSumCsvHeader() { return "method,device,photons,error,nanoseconds\n"; }

std::string FloatSumCsvLine(const FloatSumRow& row) {
  std::string device = row.device;  // without what would end the cell
  std::replace(device.begin(), device.end(), ',', ' ');
  return fmt::format("{},{},{},{:.4g},{:.4g}\n", row.method, device, row.photons, row.error,
                     row.nanoseconds);
}

}  // namespace treelight::client
