#include "server/address.h"

#include <arpa/inet.h>

#include <charconv>

#include "fmt/format.h"

namespace treelight::server {

std::string HostOf(std::string_view listen) {
  std::string_view host = listen.substr(0, listen.rfind(':'));
  if (host.size() >= 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  }
  return std::string(host);
}

int PortOf(std::string_view listen) {
  int port = 0;
  const std::string_view digits = listen.substr(listen.rfind(':') + 1);
  std::from_chars(digits.data(), digits.data() + digits.size(), port);
  return port;
}

absl::Status CheckAddress(std::string_view listen) {
  const auto wrong = [&](std::string_view why) {
    return absl::InvalidArgumentError(
        fmt::format("address '{}': {}; expected HOST:PORT or unix:/PATH", listen, why));
  };
  if (listen.starts_with("unix:")) {
    return listen.size() > 5 ? absl::OkStatus() : wrong("the path is missing");
  }
  const std::size_t colon = listen.rfind(':');
  if (colon == std::string_view::npos) return wrong("the port is missing");
  if (colon == 0) return wrong("the host is missing");
  if (listen.front() != '[' && listen.find(':') != colon) {
    return wrong("an IPv6 address stands in brackets");
  }
  const std::string_view digits = listen.substr(colon + 1);
  unsigned port = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  if (error != std::errc() || end != digits.data() + digits.size() || port > 65535) {
    return wrong("the port is no number in [0, 65535]");
  }
  return absl::OkStatus();
}

bool IsLocal(std::string_view listen) {
  if (listen.starts_with("unix:")) return true;
  const std::string host = HostOf(listen);
  if (host == "localhost" || host == "::1") return true;
  in_addr address{};
  return inet_pton(AF_INET, host.c_str(), &address) == 1 && (ntohl(address.s_addr) >> 24) == 127;
}

std::string WithPort(std::string_view listen, int port) {
  if (port == 0) return std::string(listen);
  return fmt::format("{}:{}", listen.substr(0, listen.rfind(':')), port);
}

}  // namespace treelight::server
