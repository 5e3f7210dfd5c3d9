#ifndef TREELIGHT_CLIENT_STUDY_SUMMARY_H_
#define TREELIGHT_CLIENT_STUDY_SUMMARY_H_

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "client/study/study_row.h"

namespace treelight::client {

/// A mean over seeds with its 95 % confidence interval: half its width, by Student's t; infinite
/// where there is one seed only.
struct Estimate {
  double mean = 0, half_width = 0;
};

/// The mean of `values` and its interval. Zeros where there are none.
Estimate EstimateMean(std::span<const double> values);

/// A kind of tree over a kind of photons: what the rows of all seeds and cameras say together.
/// Costs are relative to the baseline over the same photons, in percent; speeds are 100 times the
/// nodes of the baseline over those of the tree, so that more is better, as Bulavintsev and Zhdanov
/// 2020 have it.
struct SummaryRow {
  std::string scene, set;
  std::uint64_t photons = 0;
  std::uint32_t leaf_size = 0;
  Variant variant;
  std::size_t seeds = 0;
  Estimate sah, isa;                             ///< percent
  Estimate exact_speed, knn50_speed, r50_speed;  ///< percent
  Estimate knn50_tests, r50_tests;               ///< percent
  Estimate leaf_fill;                            ///< photons
  Estimate build_ms;
  /// 100 times the nodes that the baseline would visit with leaves such that it makes as many
  /// distance tests, over those of the tree: what is left of a gain when it is not bought by fuller
  /// leaves. Interpolated in the baseline's rows over leaf sizes, linear in both logarithms. 0
  /// where these do not reach so far.
  Estimate knn50_speed_at_equal_tests, r50_speed_at_equal_tests;
  std::uint32_t max_depth = 0;
};

/// Sums up; photons without a row of the baseline are left out. In the order in which the kinds
/// first stand in `rows`.
std::vector<SummaryRow> Summarise(std::span<const StudyRow> rows);

/// summary.csv: a line for each row, means and half widths in columns of their own.
std::string SummaryCsv(std::span<const SummaryRow> rows);

/// For people: a table for each set of photons.
std::string SummaryTables(std::span<const SummaryRow> rows);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_STUDY_SUMMARY_H_
