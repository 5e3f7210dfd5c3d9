#ifndef TREELIGHT_CLIENT_COMMANDS_TRACE_REPORT_H_
#define TREELIGHT_CLIENT_COMMANDS_TRACE_REPORT_H_

#include <string>

#include "client/trace/photon_tracer.h"

namespace treelight::client {

/// What tracing photons gave in `seconds`, as lines: the two sets, a table of where the emitted
/// power went, which adds up, and one of what arrived at diffuse surfaces.
std::string FormatTrace(const TraceReport& report, double seconds);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_TRACE_REPORT_H_
