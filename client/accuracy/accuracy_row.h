#ifndef TREELIGHT_CLIENT_ACCURACY_ACCURACY_ROW_H_
#define TREELIGHT_CLIENT_ACCURACY_ACCURACY_ROW_H_

#include <cstdint>
#include <string>

#include "client/accuracy/setting.h"

namespace treelight::client {

/// How far answers are from the truth: float64 brute force over all photons of the scene, at the
/// same k or radius.
struct AnswerError {
  double distance = 0;  ///< RMS over queries of R / true R - 1; 0 where k is 0
  double recall =
      1;  ///< share of the true neighbours that is found; 1 where k is 0, 0 of merged photons
  double density = 0;  ///< RMS over queries of density / true density - 1, of the channels' sum
  double bound = 0;    ///< mean of the finite error bounds, relative; see GatherResponse
};

/// What the server chose for answers from merged photons; see v1::MergeReport.
struct ChosenMerge {
  std::uint32_t merged_photons = 0;  ///< that one stands for, merged or thinned; 0: exact
  double measured_error = 0;         ///< of the server's sample
  std::uint32_t batches = 0;         ///< further ones that asked for the same error
  std::uint32_t batches_within = 0;  ///< of them, by comparison with exact answers
};

/// What the answers cost.
struct AnswerSpeed {
  double kernel_ns = 0;  ///< of one gather on the device, median of the runs
  double whole_ns = 0;   ///< of one gather as the client sees it, median of the runs
  /// Of one gather in the messages.
  double request_bytes = 0, answer_bytes = 0;
};

/// A picture beside its path-traced reference; zeros where none was rendered.
struct PictureError {
  double rmse = 0, relative_mse = 0;
  double seconds = 0;          ///< from the first ray to the last answer
  double reference_noise = 0;  ///< standard error of the reference, root mean square
};

/// A line of accuracy.csv.
struct AccuracyRow {
  std::string scene;
  std::uint64_t photons = 0;  ///< of the scene, all
  std::uint64_t seed = 1;
  std::string device;
  Setting setting{};
  float radius = 0;  ///< of the gathers, scene units; +inf: none
  std::uint32_t queries = 0, checked = 0;
  bool normals = false;  ///< whether queries have them; see AccuracyPlan
  AnswerError error{};
  ChosenMerge merge{};
  AnswerSpeed speed{};
  PictureError picture{};
};

/// The names of the columns, ending with a line's end.
std::string AccuracyCsvHeader();

/// A line, with its end.
std::string AccuracyCsvLine(const AccuracyRow& row);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_ACCURACY_ACCURACY_ROW_H_
