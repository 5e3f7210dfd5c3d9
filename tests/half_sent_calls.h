#ifndef TREELIGHT_TESTS_HALF_SENT_CALLS_H_
#define TREELIGHT_TESTS_HALF_SENT_CALLS_H_

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>

namespace treelight::testing {

/// A connection to 127.0.0.1 with calls that each send all of their request but its last byte, or
/// far more than a request, as fast as the server takes it, and then stand still. HTTP/2 by hand
/// (RFC 9113): gRPC's own client sends whole messages.
class HalfSentCalls {
 public:
  /// `calls` calls of `path` with a request of `message_bytes`.
  HalfSentCalls(int port, const std::string& path, int calls, std::uint32_t message_bytes)
      : HalfSentCalls(port, path, calls, message_bytes, message_bytes + 4) {}  // prefix less a byte

  /// The same with `sent_bytes` instead, zeros after the request: more empty requests.
  HalfSentCalls(int port, const std::string& path, int calls, std::uint32_t message_bytes,
                std::uint64_t sent_bytes) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0) return;
    Send("PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + Frame(kSettings, 0, 0, ""));
    const std::string headers = Field(":method", "POST") + Field(":scheme", "http") +
                                Field(":path", path) + Field(":authority", "x") +
                                Field("content-type", "application/grpc") + Field("te", "trailers");
    for (int i = 0; i < calls; ++i) {
      const std::uint32_t id = 2 * static_cast<std::uint32_t>(i) + 1;
      Send(Frame(kHeaders, kEndHeaders, id, headers));
      calls_[id] = {.window = kFirstWindow, .unsent = sent_bytes};
    }
    message_prefix_ = std::string(1, '\0') + Number(message_bytes);
  }
  ~HalfSentCalls() { close(socket_); }
  HalfSentCalls(const HalfSentCalls&) = delete;
  HalfSentCalls& operator=(const HalfSentCalls&) = delete;

  /// Sends what the server has room for, and reads what it says, waiting at most `wait_ms`.
  void Go(int wait_ms) {
    for (auto& [id, call] : calls_) SendSome(id, call);
    pollfd ready{.fd = socket_, .events = POLLIN, .revents = 0};
    if (poll(&ready, 1, wait_ms) <= 0) return;
    char buffer[1 << 16];
    const ssize_t count = recv(socket_, buffer, sizeof(buffer), 0);
    if (count > 0) Read(std::string(buffer, static_cast<std::size_t>(count)));
  }

  std::uint64_t sent_bytes() const { return sent_; }  ///< of requests
  int ended() const { return ended_; }                ///< calls that the server has ended

 private:
  enum Type : char { kData = 0, kHeaders = 1, kReset = 3, kSettings = 4, kPing = 6, kWindow = 8 };
  static constexpr char kEndStream = 1, kAck = 1, kEndHeaders = 4;
  static constexpr std::int64_t kFirstWindow = 65'535;
  struct OneCall {
    std::int64_t window = 0;
    std::uint64_t unsent = 0, sent = 0;
  };

  static std::string Number(std::uint32_t number) {
    const std::uint32_t big = htonl(number);
    return {reinterpret_cast<const char*>(&big), sizeof(big)};
  }
  static std::string Frame(char type, char flags, std::uint32_t stream, const std::string& body) {
    return Number(static_cast<std::uint32_t>(body.size())).substr(1) + type + flags +
           Number(stream) + body;
  }
  /// HPACK: a literal without indexing (RFC 7541, 6.2.2).
  static std::string Field(const std::string& name, const std::string& value) {
    return std::string(1, '\0') + static_cast<char>(name.size()) + name +
           static_cast<char>(value.size()) + value;
  }

  void Send(const std::string& bytes) {
    for (std::size_t first = 0; first < bytes.size();) {
      const ssize_t count = send(socket_, bytes.data() + first, bytes.size() - first, MSG_NOSIGNAL);
      if (count <= 0) return;
      first += static_cast<std::size_t>(count);
    }
  }
  void SendSome(std::uint32_t id, OneCall& call) {
    constexpr std::int64_t kMost = 16'384;
    while (call.unsent > 0 && call.window > 0 && window_ > 0) {
      const auto length = static_cast<std::size_t>(
          std::min({kMost, call.window, window_, static_cast<std::int64_t>(call.unsent)}));
      std::string body(length, '\0');
      if (call.sent == 0) std::copy(message_prefix_.begin(), message_prefix_.end(), body.begin());
      Send(Frame(kData, 0, id, body));
      call.sent += length, call.unsent -= length, sent_ += length;
      call.window -= static_cast<std::int64_t>(length);
      window_ -= static_cast<std::int64_t>(length);
    }
  }
  void Read(const std::string& bytes) {
    received_ += bytes;
    constexpr std::size_t kHead = 9;
    const auto number = [this](std::size_t at) {
      std::uint32_t big = 0;
      received_.copy(reinterpret_cast<char*>(&big), sizeof(big), at);
      return ntohl(big);
    };
    while (received_.size() >= kHead) {
      const std::size_t length = number(0) >> 8;
      if (received_.size() < kHead + length) return;
      Take(received_[3], received_[4], number(5) & 0x7fffffff, received_.substr(kHead, length));
      received_.erase(0, kHead + length);
    }
  }
  void Take(char type, char flags, std::uint32_t stream, const std::string& body) {
    const auto number = [&body](std::size_t at) {
      std::uint32_t big = 0;
      body.copy(reinterpret_cast<char*>(&big), sizeof(big), at);
      return std::int64_t{ntohl(big)};
    };
    if (type == kSettings && flags != kAck) {
      constexpr char kInitialWindow = 4;
      for (std::size_t at = 0; at + 6 <= body.size(); at += 6) {
        if (body[at + 1] != kInitialWindow) continue;
        for (auto& [id, call] : calls_) call.window += number(at + 2) - first_window_;
        first_window_ = number(at + 2);
      }
      Send(Frame(kSettings, kAck, 0, ""));
    } else if (type == kPing && flags != kAck) {
      Send(Frame(kPing, kAck, 0, body));
    } else if (type == kWindow && stream == 0) {
      window_ += number(0);
    } else if (type == kWindow && calls_.contains(stream)) {
      calls_[stream].window += number(0);
    } else if (type == kReset || (type == kHeaders && (flags & kEndStream) != 0)) {
      ended_ += static_cast<int>(calls_.erase(stream));
    }
  }

  const int socket_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  std::string message_prefix_, received_;
  std::map<std::uint32_t, OneCall> calls_;  // by stream
  std::int64_t window_ = kFirstWindow, first_window_ = kFirstWindow;
  std::uint64_t sent_ = 0;
  int ended_ = 0;
};

}  // namespace treelight::testing

#endif  // TREELIGHT_TESTS_HALF_SENT_CALLS_H_
