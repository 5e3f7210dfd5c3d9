#ifndef TREELIGHT_CLIENT_TRACE_RANDOM_H_
#define TREELIGHT_CLIENT_TRACE_RANDOM_H_

#include <array>
#include <cstdint>

namespace treelight::client {

/// Philox4x32-10 (Salmon et al. 2011, "Parallel Random Numbers: As Easy as 1, 2, 3", section 3.3):
/// a function from a counter and a key to 128 random bits.
std::array<std::uint32_t, 4> Philox(std::array<std::uint32_t, 4> counter,
                                    std::array<std::uint32_t, 2> key);

/// What random numbers are for; different purposes never share a number.
enum class RandomPurpose : std::uint32_t {
  kPhotonPath,
  kCameraSample,
  kReferencePath,
  kCausticPath,
  kImagePath,
  kImageChoice,
  kFinalGather,
  kFeatures,
  kPass,
  kCameraQuarter,
};

/// The random numbers of one path. They depend on seed, purpose and index alone, so paths may be
/// traced in any order and by any number of threads. Not thread-safe; make one per path.
class RandomStream {
 public:
  RandomStream(std::uint64_t seed, RandomPurpose purpose, std::uint64_t index);

  float Uniform();  ///< the next number, uniform in [0, 1), a multiple of 2^-24

  /// The next number, uniform in [0, 1), a multiple of 2^-53: to choose among very many.
  double FineUniform();

 private:
  std::uint32_t Next();

  std::array<std::uint32_t, 2> key_;
  std::array<std::uint32_t, 4> counter_;
  std::array<std::uint32_t, 4> block_{};
  int used_ = 4;  // of block_
};

/// The seed of pass `pass` of a picture of seed `seed`: neighbouring seeds share no pass.
std::uint64_t PassSeed(std::uint64_t seed, std::uint64_t pass);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TRACE_RANDOM_H_
