#include "client/scenes/gltf_check.h"

#include <cstdint>
#include <cstring>

#include "absl/status/status.h"
#include "client/scenes/json_text.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

using nlohmann::json;

constexpr std::size_t kHeaderSize = 12, kChunkHeaderSize = 8;  // bytes, glTF 2.0, section 4.4
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;

absl::Status Invalid(const std::string& path, std::string_view error) {
  return absl::InvalidArgumentError(fmt::format("{}: {}", path, error));
}

std::uint32_t Load(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  std::memcpy(&value, bytes.data() + at, sizeof(value));
  return value;
}

/// The JSON of a GLB, whose chunks must fill it.
absl::StatusOr<std::string_view> JsonOfGlb(std::string_view bytes, const std::string& path) {
  if (bytes.size() < kHeaderSize + kChunkHeaderSize)
    return Invalid(path, "the file ends early, in its header");
  if (Load(bytes, 4) != 2) {
    return Invalid(path, fmt::format("it is of version {}, only 2 is read", Load(bytes, 4)));
  }
  if (Load(bytes, 8) > bytes.size()) {
    return Invalid(path, fmt::format("the file ends early: it should have {} bytes and has {}",
                                     Load(bytes, 8), bytes.size()));
  }
  for (std::size_t at = kHeaderSize; at < Load(bytes, 8);) {
    const std::size_t left = Load(bytes, 8) - at;
    if (left < kChunkHeaderSize || Load(bytes, at) > left - kChunkHeaderSize) {
      return Invalid(path, fmt::format("byte {}: a chunk is longer than the file", at));
    }
    at += kChunkHeaderSize + Load(bytes, at);
  }
  if (Load(bytes, kHeaderSize + 4) != kJsonChunk)
    return Invalid(path, fmt::format("byte {}: the first chunk is not JSON", kHeaderSize + 4));
  return bytes.substr(kHeaderSize + kChunkHeaderSize, Load(bytes, kHeaderSize));
}

/// The member `key` of `value`; null where it is no object or has none.
const json* Member(const json& value, const char* key) {
  const auto found = value.is_object() ? value.find(key) : value.end();
  return found == value.end() ? nullptr : &*found;
}

/// Two parents of one node would repeat what hangs below it, up to 2^nodes times.
std::string CheckNodes(const json& nodes) {
  if (!nodes.is_array()) return "nodes is no array";
  std::vector<bool> has_parent(nodes.size());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const json* const children = Member(nodes[i], "children");
    if (children == nullptr) continue;
    for (const json& child : *children) {
      if (!child.is_number_unsigned() || child.get<std::uint64_t>() >= nodes.size()) {
        return fmt::format("nodes[{}].children: there is no such node", i);
      }
      const std::size_t index = child.get<std::size_t>();
      if (has_parent[index]) return fmt::format("nodes[{}] has two parents", index);
      has_parent[index] = true;
    }
  }
  return {};
}

}  // namespace

absl::StatusOr<std::vector<std::string>> CheckGltf(std::string_view bytes,
                                                   const std::string& path) {
  std::string_view text = bytes;
  if (bytes.starts_with("glTF")) {
    const auto json_of_glb = JsonOfGlb(bytes, path);
    if (!json_of_glb.ok()) return json_of_glb.status();
    text = *json_of_glb;
  }
  const auto gltf = ParseJson(text, path);
  if (!gltf.ok()) return gltf.status();
  if (!gltf->is_object()) return Invalid(path, "it is no JSON object");
  const json* const asset = Member(*gltf, "asset");
  const json* const version = asset == nullptr ? nullptr : Member(*asset, "version");
  if (version == nullptr || !version->is_string() ||
      !version->get_ref<const std::string&>().starts_with("2")) {
    return Invalid(path, "asset.version is not 2.x: no glTF 2");
  }
  if (const json* const nodes = Member(*gltf, "nodes"); nodes != nullptr) {
    if (const auto error = CheckNodes(*nodes); !error.empty()) return Invalid(path, error);
  }
  std::vector<std::string> names;
  const json* const buffers = Member(*gltf, "buffers");
  if (buffers == nullptr) return names;
  if (!buffers->is_array()) return Invalid(path, "buffers is no array");
  for (std::size_t i = 0; i < buffers->size(); ++i) {
    const json* const uri = Member((*buffers)[i], "uri");
    if (uri == nullptr) continue;
    if (!uri->is_string()) return Invalid(path, fmt::format("buffers[{}].uri is no string", i));
    const auto& name = uri->get_ref<const std::string&>();
    if (!name.starts_with("data:")) names.push_back(name);
  }
  return names;
}

}  // namespace treelight::client
