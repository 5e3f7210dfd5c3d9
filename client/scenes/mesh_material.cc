#include "client/scenes/mesh_material.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "assimp/GltfMaterial.h"
#include "assimp/material.h"

namespace treelight::client {
namespace {

// A lobe that reflects less than this is not worth its noise.
constexpr float kLeastSpecular = 0.01f;
// Largest exponent of a lobe: half of its power lies within 0.6 degrees, as good as a mirror.
constexpr float kLargestExponent = 1e4f;
// Materials of glTF that are smoother than this are mirrors.
constexpr float kMirrorRoughness = 0.05f;

Rgb ColorOf(const aiMaterial& source, const char* key, unsigned type, unsigned index,
            const Rgb& otherwise) {
  aiColor4D color;
  if (aiGetMaterialColor(&source, key, type, index, &color) != aiReturn_SUCCESS) return otherwise;
  return {color.r, color.g, color.b};
}

float NumberOf(const aiMaterial& source, const char* key, unsigned type, unsigned index,
               float otherwise) {
  float value = otherwise;
  if (aiGetMaterialFloat(&source, key, type, index, &value) != aiReturn_SUCCESS) return otherwise;
  return std::isfinite(value) ? value : otherwise;
}

template <typename Function>
Rgb Map(const Rgb& color, const Function& function) {
  return {function(color.r), function(color.g), function(color.b)};
}

Rgb Clamp(const Rgb& color) {
  return Map(color, [](float c) { return c >= 0 ? std::min(c, 1.0f) : 0.0f; });
}

Rgb NotNegative(const Rgb& color) {
  return Map(color, [](float c) { return c >= 0 && std::isfinite(c) ? c : 0.0f; });
}

/// Scales reflectance and specular down together, where a channel of their sum is above 1, so that
/// it becomes 1: a surface gives no energy. Whether it did.
bool LimitReflectance(Material& material) {
  const float largest = MaxChannel(material.reflectance + material.specular);
  if (largest <= 1) return false;
  // A little less than 1 / largest, as the sum of two roundings may be above 1 again.
  const float scale = (1 - 1e-6f) / largest;
  material.reflectance = scale * material.reflectance;
  material.specular = scale * material.specular;
  return true;
}

}  // namespace

TranslatedMaterial TranslateMtl(const aiMaterial& source) {
  const Rgb diffuse = NotNegative(ColorOf(source, AI_MATKEY_COLOR_DIFFUSE, {0.6f, 0.6f, 0.6f}));
  const Rgb specular = NotNegative(ColorOf(source, AI_MATKEY_COLOR_SPECULAR, {}));
  int illumination = 2;
  aiGetMaterialInteger(&source, "$mat.illum", 0, 0, &illumination);

  Material material{.name = source.GetName().C_Str(), .reflectance = {}};
  material.emission = NotNegative(ColorOf(source, AI_MATKEY_COLOR_EMISSIVE, {}));
  switch (illumination) {
    case 3:
    case 5:
      material.surface = Surface::kMirror;
      material.reflectance = MaxChannel(specular) > 0 ? specular : diffuse;
      break;
    case 4:
    case 6:
    case 7: {
      const Rgb filter = Clamp(ColorOf(source, AI_MATKEY_COLOR_TRANSPARENT, {1, 1, 1}));
      const float ior = NumberOf(source, AI_MATKEY_REFRACTI, 1);
      material.ior = ior > 0 ? ior : 1;
      const bool solid = illumination != 4 && material.ior != 1;
      material.surface = solid ? Surface::kDielectric : Surface::kPane;
      // The filter is what passes the object; a solid is entered and left.
      material.transmittance = solid ? Map(filter, [](float c) { return std::sqrt(c); }) : filter;
      break;
    }
    default:
      material.reflectance = diffuse;
      if (illumination >= 2 && MaxChannel(specular) >= kLeastSpecular) {
        material.surface = Surface::kGlossy;
        material.specular = specular;
        material.exponent =
            std::clamp(NumberOf(source, AI_MATKEY_SHININESS, 0), 0.0f, kLargestExponent);
      }
  }
  const bool scaled = LimitReflectance(material);
  return {.material = std::move(material), .scaled = scaled};
}

TranslatedMaterial TranslateGltf(const aiMaterial& source) {
  const Rgb base = Clamp(ColorOf(source, AI_MATKEY_BASE_COLOR, {1, 1, 1}));
  const float metallic = NumberOf(source, AI_MATKEY_METALLIC_FACTOR, 1);
  const float roughness = std::clamp(NumberOf(source, AI_MATKEY_ROUGHNESS_FACTOR, 1), 0.0f, 1.0f);
  const float transmission = NumberOf(source, AI_MATKEY_TRANSMISSION_FACTOR, 0);

  Material material{.name = source.GetName().C_Str(), .reflectance = base};
  if (material.name.empty()) material.name = "default";
  material.emission = NotNegative(ColorOf(source, AI_MATKEY_COLOR_EMISSIVE, {}));
  if (transmission >= 0.5f) {
    material.surface = Surface::kDielectric;
    const float ior = NumberOf(source, AI_MATKEY_REFRACTI, 1.5f);
    material.ior = ior > 0 ? ior : 1.5f;
    material.reflectance = {};
    material.transmittance = Map(base, [](float c) { return std::sqrt(c); });
  } else if (metallic >= 0.5f && roughness < kMirrorRoughness) {
    material.surface = Surface::kMirror;
  } else if (metallic >= 0.5f) {
    // The exponent whose lobe is as wide as that of alpha = roughness^2 (Walter et al. 2007,
    // "Microfacet Models for Refraction through Rough Surfaces", section 5.2).
    material.surface = Surface::kGlossy;
    material.reflectance = {};
    material.specular = base;
    const float alpha = roughness * roughness;
    material.exponent = std::clamp(2 / (alpha * alpha) - 2, 0.0f, kLargestExponent);
  }
  return {.material = std::move(material)};  // a glTF's numbers are at most 1
}

}  // namespace treelight::client
