#ifndef TREELIGHT_CLIENT_ESTIMATORS_FLOAT_SUMS_H_
#define TREELIGHT_CLIENT_ESTIMATORS_FLOAT_SUMS_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "core/builder.h"

namespace treelight::client {

/// A way to add up floats, in the order in which they come.
class FloatSum {
 public:
  virtual ~FloatSum() = default;
  virtual void Add(std::span<const float> addends) = 0;
  virtual double Total() const = 0;
};

/// Ways to add up:
/// `float`        one after the other, as a work-item does
/// `lanes_32`     32 floats in turn, whose sums are added at the end, as a sub-group does
/// `pairwise`     blocks of 128 one after the other, their sums as the leaves of a binary tree
///                (Higham 1993, "The Accuracy of Floating Point Summation")
/// `compensated`  one after the other with the rounding errors kept (Kahan 1965, "Further Remarks
///                on Reducing Truncation Errors")
/// `double`       one after the other in double, as the CPU does
std::vector<std::string> FloatSumNames();

/// A way by its name, which is one of FloatSumNames().
std::unique_ptr<FloatSum> MakeFloatSum(const std::string& name);

/// Addends of a density estimate: Epanechnikov's weight of a photon at a uniform place of the disc
/// times a power between 0.5 and 1.5 W; the same for the same seed and place in the row.
void MakeAddends(std::uint64_t first, std::uint64_t seed, std::span<float> addends);

/// One way to add up, for so many photons within the radius.
struct FloatSumRow {
  std::string method;         ///< FloatSumNames(), or "gather": densities of the map of a device
  std::string device;         ///< of "gather"; else empty
  std::uint64_t photons = 0;  ///< added up
  double error = 0;           ///< of the sum, relative, against the sum in long double
  double nanoseconds = 0;     ///< for each photon; 0 for "gather"
};

using FloatSumListener = std::function<absl::Status(const FloatSumRow& row)>;

/// Adds up to `most_photons` in every way, and tells of 10^2, 10^3, ... of them; and up to
/// `most_gathered` as the density of one gather of `builder`'s map that has them all within its
/// radius. The errors of the builder, the gather and the listener.
absl::Status MeasureFloatSums(Builder& builder, std::uint64_t most_photons,
                              std::uint64_t most_gathered, std::uint64_t seed,
                              const FloatSumListener& listener);

/// The names of the columns, ending with a line's end.
std::string FloatSumCsvHeader();

/// A line, with its end.
std::string FloatSumCsvLine(const FloatSumRow& row);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_ESTIMATORS_FLOAT_SUMS_H_
