#ifndef TREELIGHT_CLIENT_RENDER_PROGRESSIVE_CHART_H_
#define TREELIGHT_CLIENT_RENDER_PROGRESSIVE_CHART_H_

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "client/render/image.h"
#include "client/render/progressive_renderer.h"

namespace treelight::client {

/// The names of the columns of an error curve, ending with a line's end.
std::string ErrorCurveHeader();

/// A line of it, with its end: a pass, what is known of the error after it, and what a reference
/// says. What is not known is empty.
std::string ErrorCurveLine(const PassReport& pass, const std::optional<ImageError>& measured);

/// Draws an error curve, errors over passes, as FOLDER/progressive.png and .svg by Python's
/// matplotlib, with the power that fits them from pass 10 on. The script stays in the folder as
/// charts.py. FAILED_PRECONDITION: Python or matplotlib is missing; the message says what to
/// install.
absl::Status DrawErrorCurve(const std::string& csv_path, const std::string& folder);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_RENDER_PROGRESSIVE_CHART_H_
