#ifndef TREELIGHT_CLIENT_STUDY_STUDY_ROW_H_
#define TREELIGHT_CLIENT_STUDY_STUDY_ROW_H_

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "client/study/variant.h"
#include "core/search_statistics.h"

namespace treelight::client {

/// Photons that trees are built from.
struct PhotonSetName {
  std::string scene{};     ///< "sibenik"; of an input that is no scene its name: "outliers"
  std::string set{};       ///< "image", "light", or "hard"
  std::string camera{};    ///< of image photons: "front" or "back"; else empty
  std::uint32_t seed = 1;  ///< of the photons and of the searches among them
  std::uint64_t photons = 0;

  friend auto operator<=>(const PhotonSetName&, const PhotonSetName&) = default;
};

/// One tree, a line of study.csv.
struct StudyRow {
  PhotonSetName photons;
  Variant variant;
  std::uint32_t leaf_size = 0;  ///< B
  double sah_cost = 0, isa_cost = 0;
  std::uint32_t depth = 0;
  double leaf_fill = 0;
  SearchStatistics searches;
  double build_ms = 0;  ///< stages on the server, upload left out
  std::string device;
  /// Kernel time of one density estimate in a large batch at random photons, of the 50 nearest and
  /// of all within their distance, ns; 0 where it was not measured.
  double knn50_ns = 0, r50_ns = 0;

  friend bool operator==(const StudyRow&, const StudyRow&) = default;
};

/// The names of the columns, ending with a line's end.
std::string StudyCsvHeader();

/// A line, with its end.
std::string StudyCsvLine(const StudyRow& row);

/// Reads what these have written; `path` is for messages. INVALID_ARGUMENT names line and column.
absl::StatusOr<std::vector<StudyRow>> ParseStudyCsv(std::string_view text, const std::string& path);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_STUDY_STUDY_ROW_H_
