#include "client/photon_ply.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <string_view>
#include <vector>

#include "client/ply_reader.h"
#include "core/model/octahedral.h"
#include "fmt/format.h"

namespace treelight::client {
namespace {

constexpr double kViewerGamma = 2.2;
constexpr std::size_t kFlushSize = std::size_t{1} << 20;  // bytes

std::string Header(const PhotonPlyContents& contents) {
  std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment Treelight photons: power in watts\n";
  fmt::format_to(std::back_inserter(header), "element vertex {}\n", contents.count);
  header += "property float x\nproperty float y\nproperty float z\n";
  if (contents.powers) {
    header += "property float power_red\nproperty float power_green\nproperty float power_blue\n";
  }
  if (contents.directions) header += "property short dir_u\nproperty short dir_v\n";
  if (contents.powers) header += "property uchar red\nproperty uchar green\nproperty uchar blue\n";
  return header + "end_header\n";
}

template <typename T>
void Append(const T* values, int count, std::string& bytes) {
  bytes.append(reinterpret_cast<const char*>(values), sizeof(T) * count);
}

void AppendVertex(const Photons& photons, std::size_t i, float max_power, std::string& bytes) {
  Append(&photons.positions[3 * i], 3, bytes);
  if (!photons.powers.empty()) Append(&photons.powers[3 * i], 3, bytes);
  if (!photons.directions.empty()) Append(&photons.directions[2 * i], 2, bytes);
  if (photons.powers.empty()) return;
  for (int c = 0; c < 3; ++c) {
    const double share = max_power > 0 ? std::max(0.0f, photons.powers[3 * i + c]) / max_power : 0;
    bytes.push_back(static_cast<char>(std::lround(255 * std::pow(share, 1 / kViewerGamma))));
  }
}

// Which properties of a vertex make a photon, and where each is in the values of
// PlyReader::ReadVertices.
struct Layout {
  std::vector<std::string_view> properties = {"x", "y", "z"};
  int powers = -1;      // index of the first of three
  int octahedral = -1;  // index of the first of two
  int normals = -1;     // index of the first of three
};

// Adds `names` to `layout`. -1: the file has none of them.
absl::StatusOr<int> AddGroup(const PlyReader& reader, const std::string& path,
                             std::initializer_list<std::string_view> names, Layout& layout) {
  const auto present =
      std::count_if(names.begin(), names.end(), [&](auto name) { return reader.Has(name); });
  if (present == 0) return -1;
  for (const std::string_view name : names) {
    if (!reader.Has(name)) {
      return absl::InvalidArgumentError(
          fmt::format("{}: a vertex has no {}, but the rest of its group", path, name));
    }
  }
  const auto first = static_cast<int>(layout.properties.size());
  layout.properties.insert(layout.properties.end(), names);
  return first;
}

absl::StatusOr<Layout> ChooseLayout(const PlyReader& reader, const std::string& path,
                                    const PhotonAttributes& wanted) {
  Layout layout;
  if (wanted.powers) {
    const auto powers = AddGroup(reader, path, {"power_red", "power_green", "power_blue"}, layout);
    if (!powers.ok()) return powers.status();
    layout.powers = *powers;
  }
  if (!wanted.directions) return layout;
  const auto octahedral = AddGroup(reader, path, {"dir_u", "dir_v"}, layout);
  if (!octahedral.ok()) return octahedral.status();
  layout.octahedral = *octahedral;
  if (layout.octahedral >= 0) return layout;
  const auto normals = AddGroup(reader, path, {"nx", "ny", "nz"}, layout);
  if (!normals.ok()) return normals.status();
  layout.normals = *normals;
  return layout;
}

// Appends three numbers; an answer that is not empty says what is wrong with them.
std::string AppendTriple(const double* values, double max, std::string_view name,
                         std::vector<float>& array) {
  for (int c = 0; c < 3; ++c) {
    if (!(std::fabs(values[c]) <= max)) {  // also catches NaN
      return fmt::format("number {} of its {} is {}, it must be finite and within {:g}", c, name,
                         values[c], max);
    }
    array.push_back(static_cast<float>(values[c]));
  }
  return {};
}

std::string AppendOctahedral(const double* values, std::vector<std::int16_t>& directions) {
  using Limits = std::numeric_limits<std::int16_t>;
  for (int c = 0; c < 2; ++c) {
    if (!(values[c] >= Limits::min() && values[c] <= Limits::max()) ||
        values[c] != std::trunc(values[c])) {
      return fmt::format("dir_{} is {}, it must be a 16-bit integer", "uv"[c], values[c]);
    }
    directions.push_back(static_cast<std::int16_t>(values[c]));
  }
  return {};
}

std::string AppendNormal(const double* values, std::vector<std::int16_t>& directions) {
  const double length = std::hypot(values[0], values[1], values[2]);
  if (!(length > 0) || !std::isfinite(length))
    return fmt::format("its normal has length {}", length);
  const auto code = EncodeOctahedral({static_cast<float>(values[0] / length),
                                      static_cast<float>(values[1] / length),
                                      static_cast<float>(values[2] / length)});
  directions.insert(directions.end(), code.begin(), code.end());
  return {};
}

}  // namespace

absl::Status WritePhotonPly(const std::string& path, const Photons& photons) {
  auto file = OutputFile::Create(path);
  if (!file.ok()) return file.status();
  return WritePhotonPly(*std::move(file), photons);
}

absl::Status WritePhotonPly(OutputFile file, const Photons& photons) {
  auto writer = PhotonPlyWriter::Create(
      std::move(file),
      {.count = photons.size(),
       .powers = !photons.powers.empty(),
       .directions = !photons.directions.empty(),
       .max_power = photons.powers.empty()
                        ? 0
                        : *std::max_element(photons.powers.begin(), photons.powers.end())});
  if (!writer.ok()) return writer.status();
  if (const auto status = writer->Write(photons); !status.ok()) return status;
  return writer->Commit();
}

absl::StatusOr<PhotonPlyWriter> PhotonPlyWriter::Create(OutputFile file,
                                                        const PhotonPlyContents& contents) {
  if (const auto status = file.Write(Header(contents)); !status.ok()) return status;
  return PhotonPlyWriter(std::move(file), contents);
}

absl::Status PhotonPlyWriter::Write(const Photons& block) {
  const std::size_t n = block.size();
  if (block.positions.size() != 3 * n || block.powers.size() != (contents_.powers ? 3 * n : 0) ||
      block.directions.size() != (contents_.directions ? 2 * n : 0)) {
    return absl::InvalidArgumentError("arrays of photons are of unequal length");
  }
  std::string bytes;
  for (std::size_t i = 0; i < n; ++i) {
    AppendVertex(block, i, contents_.max_power, bytes);
    if (bytes.size() < kFlushSize) continue;
    if (const auto status = file_.Write(bytes); !status.ok()) return status;
    bytes.clear();
  }
  written_ += n;
  return file_.Write(bytes);
}

absl::Status PhotonPlyWriter::Commit() {
  if (written_ != contents_.count) {
    return absl::InvalidArgumentError(
        fmt::format("{} photons were written, {} announced", written_, contents_.count));
  }
  return file_.Commit();
}

absl::StatusOr<Photons> ReadPhotonPly(const std::string& path, const PhotonAttributes& wanted) {
  auto reader = PlyReader::Open(path);
  if (!reader.ok()) return reader.status();
  const auto layout = ChooseLayout(*reader, path, wanted);
  if (!layout.ok()) return layout.status();

  Photons photons;
  photons.positions.reserve(3 * reader->vertex_count());
  if (layout->powers >= 0) photons.powers.reserve(3 * reader->vertex_count());
  if (layout->octahedral >= 0 || layout->normals >= 0)
    photons.directions.reserve(2 * reader->vertex_count());
  const auto status = reader->ReadVertices(
      layout->properties, [&](std::uint64_t i, std::span<const double> values) {
        std::string error = AppendTriple(&values[0], kMaxCoordinate, "position", photons.positions);
        if (error.empty() && layout->powers >= 0) {
          error = AppendTriple(&values[layout->powers], std::numeric_limits<float>::max(), "power",
                               photons.powers);
        }
        if (error.empty() && layout->octahedral >= 0) {
          error = AppendOctahedral(&values[layout->octahedral], photons.directions);
        }
        if (error.empty() && layout->normals >= 0)
          error = AppendNormal(&values[layout->normals], photons.directions);
        return error.empty() ? absl::OkStatus() : reader->VertexError(i, error);
      });
  if (!status.ok()) return status;
  return photons;
}

}  // namespace treelight::client
