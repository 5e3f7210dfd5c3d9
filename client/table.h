#ifndef TREELIGHT_CLIENT_TABLE_H_
#define TREELIGHT_CLIENT_TABLE_H_

#include <string>
#include <vector>

namespace treelight::client {

/// Cells of text that are printed in aligned columns.
struct Table {
  std::vector<std::string> head;               ///< names of the columns; empty for none
  std::vector<std::vector<std::string>> rows;  ///< each as long as the others and as `head`
};

/// `table` as lines. A column in which all cells below the head begin with a digit, '-' or '+'
/// stands to the right, any other to the left; two blanks between columns, none at the end of a
/// line.
std::string Format(const Table& table);

/// A number of bytes for people: "812 B", "3.4 MiB".
std::string FormatBytes(double bytes);

/// A time for people, from microseconds: "0.81 ms", "12.3 s".
std::string FormatMicroseconds(double microseconds);

}  // namespace treelight::client

#endif  // TREELIGHT_CLIENT_TABLE_H_
