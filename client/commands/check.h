#ifndef TREELIGHT_CLIENT_COMMANDS_CHECK_H_
#define TREELIGHT_CLIENT_COMMANDS_CHECK_H_

#include "CLI/CLI.hpp"

namespace treelight::client {

/// A number in [min, max]. CLI::Range lets NaN pass.
CLI::Validator NumberIn(double min, double max);

/// A whole number below 2^64, without a sign. CLI11 alone reads -1, and what is too large, as
/// others.
CLI::Validator WithoutSign();

/// A name as the server takes it: 1 to 128 characters of A-Z a-z 0-9 . _ -
CLI::Validator ServerName();

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_COMMANDS_CHECK_H_
