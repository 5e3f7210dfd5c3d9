#ifndef TREELIGHT_TESTS_HTTP2_FRAMES_H_
#define TREELIGHT_TESTS_HTTP2_FRAMES_H_

#include <arpa/inet.h>
#include <sys/socket.h>

#include <cstdint>
#include <string>

// HTTP/2 by hand (RFC 9113): gRPC's own client does not do what clients should not do.
namespace treelight::testing::http2 {

enum Type : char {
  kData = 0,
  kHeaders = 1,
  kReset = 3,
  kSettings = 4,
  kPing = 6,
  kWindow = 8,
  kContinuation = 9
};
inline constexpr char kEndStream = 1, kAck = 1, kEndHeaders = 4;

/// Four bytes, the highest first.
inline std::string Number(std::uint32_t number) {
  const std::uint32_t big = htonl(number);
  return {reinterpret_cast<const char*>(&big), sizeof(big)};
}

inline std::string Frame(char type, char flags, std::uint32_t stream, const std::string& body) {
  return Number(static_cast<std::uint32_t>(body.size())).substr(1) + type + flags + Number(stream) +
         body;
}

/// What a connection begins with.
inline std::string Preface() {
  return "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + Frame(kSettings, 0, 0, "");
}

/// HPACK: a literal without indexing (RFC 7541, 6.2.2), of at most 126 bytes each.
inline std::string Field(const std::string& name, const std::string& value) {
  return std::string(1, '\0') + static_cast<char>(name.size()) + name +
         static_cast<char>(value.size()) + value;
}

/// Fields of the headers of a call of `path`.
inline std::string CallHeaders(const std::string& path) {
  return Field(":method", "POST") + Field(":scheme", "http") + Field(":path", path) +
         Field(":authority", "x") + Field("content-type", "application/grpc") +
         Field("te", "trailers");
}

/// Connects `socket` to `port` of 127.0.0.1; whether that went well.
inline bool Connect(int socket, int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  return connect(socket, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
}

}  // namespace treelight::testing::http2

#endif  // TREELIGHT_TESTS_HTTP2_FRAMES_H_
