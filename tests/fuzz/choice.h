#ifndef TREELIGHT_TESTS_FUZZ_CHOICE_H_
#define TREELIGHT_TESTS_FUZZ_CHOICE_H_

#include <cstdint>
#include <string>

namespace treelight::fuzz {

/// An input of a fuzzer of several functions: its first byte chooses, the rest are what they read.
struct Choice {
  unsigned which;
  std::string bytes;

  Choice(const std::uint8_t* data, std::size_t size)
      : which(size == 0 ? 0 : data[0]),
        bytes(reinterpret_cast<const char*>(data) + (size == 0 ? 0 : 1), size == 0 ? 0 : size - 1) {
  }
};

}  // namespace treelight::fuzz

#endif  // TREELIGHT_TESTS_FUZZ_CHOICE_H_
