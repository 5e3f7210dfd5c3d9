#ifndef TREELIGHT_CLIENT_STUDY_SAMPLE_H_
#define TREELIGHT_CLIENT_STUDY_SAMPLE_H_

#include <cstdint>
#include <span>
#include <vector>

namespace treelight::client {

/// `count` of the positions [3n], chosen with replacement, each with the same probability; empty
/// where there are none. The same for the same seed on every machine.
std::vector<float> SamplePositions(std::span<const float> positions, std::uint32_t count,
                                   std::uint64_t seed);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_STUDY_SAMPLE_H_
