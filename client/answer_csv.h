#ifndef TREELIGHT_CLIENT_ANSWER_CSV_H_
#define TREELIGHT_CLIENT_ANSWER_CSV_H_

#include <cstddef>
#include <cstdint>
#include <string>

#include "core/gatherer.h"

namespace treelight::client {

/// The first line of the CSV of answers with these outputs (a mask of kOutput bits), with its end:
///   query                                  index of the query
///   count                                  COUNT
///   radius                                 RADIUS, scene units, inf where unlimited
///   density_red,density_green,density_blue  DENSITY
///   nodes_visited,distance_tests           STATISTICS
///   error_bound                            ERROR_BOUND, inf where nothing is known
///   neighbor_ids,neighbor_squared_distances  NEIGHBORS, each a list with blanks between, nearest
///   first
std::string AnswerCsvHeader(std::uint32_t outputs);

/// A line for each query of `result`; `first_query` is the index of its first. Floats have as many
/// digits as give the same bits when they are read again. The padding of neighbour lists is left
/// out.
std::string AnswerCsvLines(const GatherResult& result, std::uint32_t outputs, std::uint32_t k,
                           std::size_t query_count, std::size_t first_query);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_ANSWER_CSV_H_
