#include "client/trace/random.h"

namespace treelight::client {

std::array<std::uint32_t, 4> Philox(std::array<std::uint32_t, 4> counter,
                                    std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t product0 = std::uint64_t{0xD2511F53} * counter[0];
    const std::uint64_t product1 = std::uint64_t{0xCD9E8D57} * counter[2];
    counter = {static_cast<std::uint32_t>(product1 >> 32) ^ counter[1] ^ key[0],
               static_cast<std::uint32_t>(product1),
               static_cast<std::uint32_t>(product0 >> 32) ^ counter[3] ^ key[1],
               static_cast<std::uint32_t>(product0)};
    key[0] += 0x9E3779B9;
    key[1] += 0xBB67AE85;
  }
  return counter;
}

RandomStream::RandomStream(std::uint64_t seed, RandomPurpose purpose, std::uint64_t index)
    : key_{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32)},
      counter_{0, static_cast<std::uint32_t>(purpose), static_cast<std::uint32_t>(index),
               static_cast<std::uint32_t>(index >> 32)} {}

std::uint32_t RandomStream::Next() {
  if (used_ == 4) {
    block_ = Philox(counter_, key_);
    ++counter_[0];
    used_ = 0;
  }
  return block_[used_++];
}

float RandomStream::Uniform() { return static_cast<float>(Next() >> 8) * 0x1p-24f; }

double RandomStream::FineUniform() {
  const std::uint64_t high = Next() >> 5, low = Next() >> 6;
  return static_cast<double>(high << 26 | low) * 0x1p-53;
}

std::uint64_t PassSeed(std::uint64_t seed, std::uint64_t pass) {
  const auto number = RandomStream(seed, RandomPurpose::kPass, pass).FineUniform();
  return static_cast<std::uint64_t>(number * 0x1p53);
}

}  // namespace treelight::client
