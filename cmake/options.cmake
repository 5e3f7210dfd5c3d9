# Compile options that every target of the project links: warnings are errors, no contraction of a*b+c, so that the
# host computes the same bits as the kernels.
add_library(treelight_options INTERFACE)
target_include_directories(treelight_options INTERFACE ${PROJECT_SOURCE_DIR})
target_compile_options(treelight_options INTERFACE -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Wno-psabi -Werror -ffp-contract=off)
if(TREELIGHT_FUZZ)  # counters of what is reached; the fuzzers link libFuzzer itself
  target_compile_options(treelight_options INTERFACE -fsanitize=fuzzer-no-link)
endif()
set(TREELIGHT_SANITIZE "" CACHE STRING "Sanitizers to build with, as in -fsanitize=...: address,undefined or thread")
if(TREELIGHT_SANITIZE)
  target_compile_options(treelight_options INTERFACE -fsanitize=${TREELIGHT_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all)
  target_link_options(treelight_options INTERFACE -fsanitize=${TREELIGHT_SANITIZE})
endif()
