#include "client/study/variant.h"

#include <algorithm>

#include "client/build_names.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

const std::string kLeaf = "leaf_size", kNone = "none";

Variant Plain(const std::string& builder) { return {.builder = builder}; }

Variant Sweep(const std::string& heuristic, const std::string& leaf_term) {
  return {.builder = heuristic, .heuristic = heuristic, .leaf_term = leaf_term};
}

Variant Treelets(const std::string& builder, const std::string& heuristic,
                 const std::string& leaf_term, std::uint32_t treelet_size, std::uint32_t rounds) {
  return {.builder = builder,
          .heuristic = heuristic,
          .leaf_term = leaf_term,
          .treelet_size = treelet_size,
          .rounds = rounds};
}

Variant Hybrid(const std::string& leaf_term, std::uint32_t subtree_size) {
  return {.builder = "hybrid",
          .heuristic = "isa",
          .leaf_term = leaf_term,
          .subtree_size = subtree_size};
}

std::vector<Variant> AllVariants() {
  return {Plain("karras"),
          Plain("lbvh"),
          Treelets("treelet", "sah", kNone, 7, 1),
          Treelets("treelet", "sah", kNone, 7, 3),
          Treelets("treelet", "isa", kNone, 7, 1),
          Treelets("treelet", "isa", kNone, 7, 3),
          Treelets("treelet", "isa", kLeaf, 5, 1),
          Treelets("treelet", "isa", kLeaf, 7, 1),
          Treelets("treelet", "isa", kLeaf, 7, 3),
          Treelets("treelet", "isa", kLeaf, 9, 1),
          Treelets("treelet", "isa", kLeaf, 9, 3),
          Treelets("treelet", "isa", kLeaf, 16, 1),
          Treelets("treelet", "vvh", kLeaf, 7, 3),
          Treelets("trbvh", "sah", kNone, 7, 1),
          Treelets("trbvh", "isa", kLeaf, 7, 3),
          Treelets("atrbvh", "sah", kNone, 9, 1),
          Hybrid(kLeaf, 256),
          Hybrid(kLeaf, 1024),
          Hybrid(kLeaf, 4096),
          Hybrid(kNone, 256),
          {.builder = "balanced", .leaf_term = kNone},
          {.builder = "balanced", .leaf_term = kLeaf},
          Sweep("sah", kNone),
          Sweep("sah", kLeaf),
          Sweep("vvh", kLeaf),
          Sweep("isa", kNone),
          Sweep("isa", kLeaf)};
}

std::vector<Variant> FewVariants() {
  return {Plain("karras"),
          Plain("lbvh"),
          Treelets("treelet", "sah", kNone, 7, 1),
          Treelets("treelet", "isa", kLeaf, 7, 1),
          Treelets("treelet", "isa", kLeaf, 7, 3),
          Treelets("treelet", "isa", kLeaf, 9, 3),
          Hybrid(kLeaf, 256),
          Hybrid(kLeaf, 1024),
          Hybrid(kLeaf, 4096),
          Sweep("isa", kLeaf)};
}

std::vector<Variant> CurveVariants() {
  return {Plain("karras"),    Plain("lbvh"),      Treelets("treelet", "isa", kLeaf, 7, 3),
          Hybrid(kLeaf, 256), Hybrid(kNone, 256), Sweep("isa", kLeaf),
          Sweep("isa", kNone)};
}

}  // namespace

std::string Label(const Variant& variant) {
  std::string label = variant.builder;
  if (!variant.heuristic.empty() && variant.heuristic != variant.builder)
    label += " " + variant.heuristic;
  if (variant.leaf_term == kLeaf) label += "+leaf";
  if (variant.rounds > 0) label += fmt::format(" {}x{}", variant.treelet_size, variant.rounds);
  if (variant.subtree_size > 0) label += fmt::format(" {}", variant.subtree_size);
  return label;
}

v1::BuildOptions OptionsOf(const Variant& variant, std::uint32_t leaf_size, float radius) {
  v1::BuildOptions options;
  SetBuilder(variant.builder, options);
  options.set_heuristic(HeuristicNamed(variant.heuristic));
  options.set_leaf_term(variant.leaf_term == kNone   ? v1::LEAF_TERM_NONE
                        : variant.leaf_term == kLeaf ? v1::LEAF_TERM_LEAF_SIZE
                                                     : v1::LEAF_TERM_UNSPECIFIED);
  options.set_treelet_size(variant.treelet_size);
  options.set_rounds(variant.rounds);
  options.set_subtree_size(variant.subtree_size);
  options.set_max_leaf_size(leaf_size);
  options.set_radius(radius);
  return options;
}

std::vector<Variant> StudyVariants(VariantChoice choice, std::uint32_t leaf_size) {
  std::vector<Variant> variants = choice == VariantChoice::kAll   ? AllVariants()
                                  : choice == VariantChoice::kFew ? FewVariants()
                                                                  : CurveVariants();
  if (leaf_size > 1) return variants;
  std::vector<Variant> different;
  for (Variant& variant : variants) {
    if (variant.leaf_term == kLeaf) variant.leaf_term = kNone;
    if (std::find(different.begin(), different.end(), variant) == different.end())
      different.push_back(variant);
  }
  return different;
}

}  // namespace treelight::client
