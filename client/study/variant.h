#ifndef TREELIGHT_CLIENT_STUDY_VARIANT_H_
#define TREELIGHT_CLIENT_STUDY_VARIANT_H_

#include <cstdint>
#include <string>
#include <vector>

#include "treelight/v1/photon_map.pb.h"

namespace treelight::client {

/// How a tree is built, as a row of the study names it. Fields that the builder does not read are
/// empty or 0.
struct Variant {
  std::string builder{};    ///< as BuilderNames() of build_names.h: "karras", "treelet", "isa"
  std::string heuristic{};  ///< of treelets and hybrid, and of a sweep its name again
  std::string leaf_term{};  ///< "leaf_size" or "none"
  std::uint32_t treelet_size = 0, rounds = 0;
  std::uint32_t subtree_size = 0;  ///< T of hybrid

  friend auto operator<=>(const Variant&, const Variant&) = default;
};

/// What all else is relative to: Karras 2012 with codes of 30 bits on a grid with as many cells
/// along each axis, equal codes in the order of upload.
inline bool IsBaseline(const Variant& variant) { return variant.builder == "karras"; }

/// For people, short: "treelet isa+leaf 7x3", "hybrid isa 256", "isa+leaf".
std::string Label(const Variant& variant);

/// What a server is asked for.
v1::BuildOptions OptionsOf(const Variant& variant, std::uint32_t leaf_size, float radius);

/// How many variants are measured.
enum class VariantChoice {
  kAll,    ///< all of the study
  kFew,    ///< those that the answer is about
  kCurve,  ///< those that are drawn over leaf sizes
};

/// The variants for leaves of at most `leaf_size` photons, the baseline first. With leaves of one
/// photon no leaf term has an effect: there is one variant then where there are two otherwise.
std::vector<Variant> StudyVariants(VariantChoice choice, std::uint32_t leaf_size);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_STUDY_VARIANT_H_
